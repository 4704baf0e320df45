/* A program with a hierarchy of its own: two groups of oil drums, cylinders in boxes. Planes that a group is inside of are
 * not asked about its drums again, and what was outside in the last frame is not looked at while the view has moved too
 * little to change that. */
#include <stdio.h>
#include <umbrage/umbrage.h>

enum { DRUMS = 4 };

typedef struct group {
    umb_volume box, drums[DRUMS];
    umb_bounds_past past, drum_past[DRUMS];
} group;

static void stack(group *g, float x)
{
    *g = (group){.box = {.kind = UMB_VOLUME_BOX, .box = {{x - 0.5f, 0, -0.5f}, {x + 6.5f, 2, 0.5f}}}};
    for (int k = 0; k < DRUMS; ++k) {
        g->drums[k] = (umb_volume){
            .kind = UMB_VOLUME_CYLINDER, .center = {x + 2.0 * k, 1, 0}, .axis = {{0, 1, 0}}, .radius = 0.5};
    }
}

int main(void)
{
    const uint32_t switches = UMB_BOUNDS_PLANE | UMB_BOUNDS_MOTION;
    const char *const words[] = {"outside", "crossing", "inside"};
    group groups[2];
    umb_bounds_frustum frustum;
    stack(&groups[0], -8.0f);
    stack(&groups[1], 40.0f);
    for (int frame = 0; frame < 3; ++frame) {
        const double eye[] = {0.5 * frame, 1, 10}, target[] = {0.5 * frame, 1, 0}, up[] = {0, 1, 0};
        umb_view view;
        umb_view_look_at(&view, eye, target, up, 0.8, 1.5, 0.1, 100.0);
        umb_bounds_prepare(&frustum, &view, frame > 0 ? &frustum : NULL);
        for (int k = 0; k < 2; ++k) {
            group *g = &groups[k];
            uint16_t planes = UINT16_MAX;
            umb_place place = umb_bounds_test_again(&frustum, &g->box, switches, &g->past, &planes);
            printf("frame %d: group %d is %s", frame, k, words[place]);
            for (int d = 0; d < DRUMS && place == UMB_PLACE_CROSSING; ++d) {
                uint16_t left = planes;
                place = umb_bounds_test_again(&frustum, &g->drums[d], switches, &g->drum_past[d], &left);
                printf("%s %s", d == 0 ? ":" : ",", words[place]);
                place = UMB_PLACE_CROSSING;
            }
            printf("\n");
        }
    }
    return 0;
}
