# A camera path from the places where players start in a Quake 3 level: one view from each, at eye
# height, in the direction that the player would face. README.md says how to run it.
/^\{/ { class = ""; origin = ""; angle = 0 }
/^"classname"/ { class = value($0) }
/^"origin"/ { origin = value($0) }
/^"angle"/ { angle = value($0) }
/^\}/ && class ~ /^(info_player_deathmatch|team_CTF_(red|blue)(spawn|player))$/ && split(origin, at, " ") == 3 {
    if (seen[origin, angle]++) { next }
    turn = angle * 3.14159265358979 / 180
    eye = at[3] + 26
    printf "%g,%g,%g,%.2f,%.2f,%g\n", at[1], at[2], eye, at[1] + 100 * cos(turn), at[2] + 100 * sin(turn), eye
}

function value(line,    part)
{
    split(line, part, "\"")
    return part[4]
}
