/* An example of a haptic plug-in without a wrist (version 1): fingers side by side that lift what is above
 * them, as a machine would, and hold it there. Its argument is how far, in metres: "0.02".
 *
 *   cc -std=c11 -shared -fPIC -I /usr/include/kiroku lifting_finger.c -o lifting_finger.so
 *   kiroku train exclusion --hand plugin:./lifting_finger.so:0.02 --fingers 3 -o lifted
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "haptic_plugin.h"

/* Below the border of object A, before it is touched. */
static const double kBegin_m[3] = {0.0, -0.046, -0.027};
static const double kApart_m = 0.04, kStep_m = 1e-5; /* a step is a thousandth of a second */

typedef struct {
  uint32_t fingers;
  double lifted_m, goal_m;
} Hand;

static void* open_hand(const char* argument, uint32_t fingers, char* error, size_t error_size) {
  char* end = NULL;
  const double goal_m = strtod(argument, &end);
  if (end == argument || *end != '\0' || !(goal_m > 0 && goal_m < 0.1)) {
    snprintf(error, error_size, "'%s' is no height: give metres, as 0.02", argument);
    return NULL;
  }
  Hand* hand = malloc(sizeof *hand);
  if (hand == NULL) {
    snprintf(error, error_size, "there is no memory");
    return NULL;
  }
  hand->fingers = fingers;
  hand->lifted_m = 0;
  hand->goal_m = goal_m;
  return hand;
}

static int read_poses(void* device, KirokuHapticPose* poses) {
  Hand* hand = device;
  if (hand->lifted_m < hand->goal_m) hand->lifted_m += kStep_m;
  for (uint32_t i = 0; i < hand->fingers; ++i) {
    memset(&poses[i], 0, sizeof poses[i]);
    poses[i].position_m[0] = kBegin_m[0] + kApart_m * (i - (hand->fingers - 1) / 2.0);
    poses[i].position_m[1] = kBegin_m[1];
    poses[i].position_m[2] = kBegin_m[2] + hand->lifted_m;
    poses[i].orientation[0] = 1;
  }
  return KIROKU_HAPTIC_DONE;
}

static int play_forces(void* device, const KirokuHapticForce* forces) {
  (void)device;
  (void)forces; /* a real device turns them into currents */
  return KIROKU_HAPTIC_DONE;
}

static void close_hand(void* device) { free(device); }

const KirokuHapticPlugin* kiroku_haptic_plugin(void) {
  static const KirokuHapticPlugin kPlugin = {KIROKU_HAPTIC_ABI, 0,           open_hand,
                                             read_poses,        play_forces, close_hand};
  return &kPlugin;
}
