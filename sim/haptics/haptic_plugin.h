/* A haptic device as a plug-in of Kiroku: a shared library that gives where fingers are and plays what they
 * feel. Plain C, so that any compiler and language can make one.
 *
 * The library exports kiroku_haptic_plugin(), which returns a table that lives as long as the library. Kiroku
 * calls open() once, then read() and write() about a thousand times a second from one thread, then close().
 * read() and write() must return at once and must not wait, allocate or print; no function may let an
 * exception out or end the program.
 *
 * Lengths are metres, forces newtons, in the axes of the organ's mesh. What a plug-in gives is checked and
 * what it is given is limited (docs/explanation/training.md, "A device that fails"), but a device of strength
 * needs a limit of its own too.
 */
#ifndef KIROKU_HAPTIC_PLUGIN_H
#define KIROKU_HAPTIC_PLUGIN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Changes whenever a table or a structure does; a plug-in of another one is refused. */
#define KIROKU_HAPTIC_ABI 1

/* The middle of a fingertip and its orientation, a unit quaternion w, x, y, z. */
typedef struct KirokuHapticPose {
  double position_m[3];
  double orientation[4];
} KirokuHapticPose;

typedef struct KirokuHapticForce {
  double n[3];
} KirokuHapticForce;

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

/* What the library exports. */
const KirokuHapticPlugin* kiroku_haptic_plugin(void);

#ifdef __cplusplus
}
#endif
#endif
