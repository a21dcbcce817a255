/* A haptic device as a plug-in of Kiroku: a shared library that gives where fingers and wrist are and plays
 * what they feel. Plain C, so that any compiler and language can make one.
 *
 * The library exports a function that returns a table, which lives as long as the library:
 *
 *   version 2   kiroku_haptic_plugin_2()   fingers and a wrist
 *   version 1   kiroku_haptic_plugin()     fingers alone
 *
 * A library that has both is used by its second version, and by older programs by its first. Kiroku calls
 * open() once, then read() and write() about a thousand times a second from one thread, then close().
 * read() and write() must return at once and must not wait, allocate or print; no function may let an
 * exception out or end the program.
 *
 * Lengths are metres, forces newtons, torques newton metres, in the axes of the organ's mesh. What a plug-in
 * gives is checked and what it is given is limited (docs/explanation/training.md, "A device that fails"), but
 * a device of strength needs a limit of its own too.
 */
#ifndef KIROKU_HAPTIC_PLUGIN_H
#define KIROKU_HAPTIC_PLUGIN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What stands in a table's `abi`; a table with another number is refused. */
#define KIROKU_HAPTIC_ABI 1
#define KIROKU_HAPTIC_ABI_2 2

/* The middle of a fingertip, of an instrument's handle (z along its shaft, to the tip), or of the wrist, and
 * its orientation, a unit quaternion w, x, y, z. */
typedef struct KirokuHapticPose {
  double position_m[3];
  double orientation[4];
} KirokuHapticPose;

typedef struct KirokuHapticForce {
  double n[3];
} KirokuHapticForce;

/* What the wrist bears: the sum of the reaction forces on all that the hand touches with, and their torque
 * about the wrist's position. */
typedef struct KirokuHapticWristForce {
  double n[3];
  double nm[3];
} KirokuHapticWristForce;

/* What read() and write() return. */
enum {
  KIROKU_HAPTIC_NOTHING = 0, /* read: no pose came since the last call */
  KIROKU_HAPTIC_DONE = 1,
  KIROKU_HAPTIC_LOST = -1 /* the device is gone: close() is all that is called from then on */
};

typedef struct KirokuHapticPlugin {
  uint32_t abi;      /* KIROKU_HAPTIC_ABI */
  uint32_t reserved; /* 0 */
  /* `argument` is what stands after the plug-in's path, "" for nothing. Returns what the others are given, or
   * null with a sentence in `error` (ended by 0, at most `error_size` bytes with it). */
  void* (*open)(const char* argument, uint32_t fingers, char* error, size_t error_size);
  /* The newest pose of every finger into `poses`, as many as open() was told. */
  int (*read)(void* device, KirokuHapticPose* poses);
  /* Plays a force on every finger. */
  int (*write)(void* device, const KirokuHapticForce* forces);
  void (*close)(void* device);
} KirokuHapticPlugin;

typedef struct KirokuHapticPlugin2 {
  uint32_t abi;      /* KIROKU_HAPTIC_ABI_2 */
  uint32_t reserved; /* 0 */
  /* As of version 1. */
  void* (*open)(const char* argument, uint32_t fingers, char* error, size_t error_size);
  /* The newest pose of every finger into `poses`, and the wrist's into `wrist`. */
  int (*read)(void* device, KirokuHapticPose* poses, KirokuHapticPose* wrist);
  /* Plays a force on every finger, and a force and a torque on the wrist. */
  int (*write)(void* device, const KirokuHapticForce* forces, const KirokuHapticWristForce* wrist);
  void (*close)(void* device);
} KirokuHapticPlugin2;

/* What the library exports, one or both. */
const KirokuHapticPlugin* kiroku_haptic_plugin(void);
const KirokuHapticPlugin2* kiroku_haptic_plugin_2(void);

#ifdef __cplusplus
}
#endif
#endif
