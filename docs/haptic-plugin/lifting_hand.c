/* An example of a haptic plug-in with a wrist (version 2): a hand that lifts what is above its fingers until
 * the wrist bears too much, and holds it there. Its argument is how far at most, in metres, and how much, in
 * newtons: "0.02:3".
 *
 *   cc -std=c11 -shared -fPIC -I /usr/include/kiroku lifting_hand.c -o lifting_hand.so
 *   kiroku train exclusion --hand plugin:./lifting_hand.so:0.02:3 --fingers 3 -o lifted
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "haptic_plugin.h"

/* Below the border of object A, before it is touched; the wrist is a hand's length in front of it. */
static const double kBegin_m[3] = {0.0, -0.046, -0.027}, kWrist_m[3] = {0.0, -0.22, -0.05};
static const double kApart_m = 0.04, kStep_m = 1e-5; /* a step is a thousandth of a second */

typedef struct {
  uint32_t fingers;
  double lifted_m, goal_m, most_n, borne_n;
} Hand;

static void* open_hand(const char* argument, uint32_t fingers, char* error, size_t error_size) {
  char* end = NULL;
  const double goal_m = strtod(argument, &end);
  const double most_n = *end == ':' ? strtod(end + 1, &end) : 0;
  if (*end != '\0' || !(goal_m > 0 && goal_m < 0.1) || !(most_n > 0 && most_n <= 20)) {
    snprintf(error, error_size, "'%s' is no height and force: give metres and newtons, as 0.02:3", argument);
    return NULL;
  }
  Hand* hand = calloc(1, sizeof *hand);
  if (hand == NULL) {
    snprintf(error, error_size, "there is no memory");
    return NULL;
  }
  hand->fingers = fingers;
  hand->goal_m = goal_m;
  hand->most_n = most_n;
  return hand;
}

static void place(KirokuHapticPose* pose, const double at_m[3], double aside_m, double lifted_m) {
  memset(pose, 0, sizeof *pose);
  pose->position_m[0] = at_m[0] + aside_m;
  pose->position_m[1] = at_m[1];
  pose->position_m[2] = at_m[2] + lifted_m;
  pose->orientation[0] = 1;
}

static int read_poses(void* device, KirokuHapticPose* poses, KirokuHapticPose* wrist) {
  Hand* hand = device;
  if (hand->lifted_m < hand->goal_m && hand->borne_n < hand->most_n) hand->lifted_m += kStep_m;
  for (uint32_t i = 0; i < hand->fingers; ++i)
    place(&poses[i], kBegin_m, kApart_m * (i - (hand->fingers - 1) / 2.0), hand->lifted_m);
  place(wrist, kWrist_m, 0, hand->lifted_m);
  return KIROKU_HAPTIC_DONE;
}

static int play_forces(void* device, const KirokuHapticForce* forces, const KirokuHapticWristForce* wrist) {
  (void)forces; /* a real device turns them into currents */
  ((Hand*)device)->borne_n = -wrist->n[2];
  return KIROKU_HAPTIC_DONE;
}

static void close_hand(void* device) { free(device); }

const KirokuHapticPlugin2* kiroku_haptic_plugin_2(void) {
  static const KirokuHapticPlugin2 kPlugin = {KIROKU_HAPTIC_ABI_2, 0,           open_hand,
                                              read_poses,          play_forces, close_hand};
  return &kPlugin;
}
