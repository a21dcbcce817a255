// The walls of the box: what a process that decodes may still ask of the kernel. Linux on any processor that
// libseccomp knows.
#pragma once

#include <string_view>

namespace kiroku::media {

/// What a box needs besides memory, threads, clocks and its channel.
enum class BoxNeeds {
  kNothing,  // what it decodes comes through descriptors that it has
  kNetwork,  // sockets of IPv4 and IPv6
  kServer,   // the same, and connections that others make to it
  kDevice,   // the controls of a V4L2 device that is open
};

/// At the very beginning of a boxed program, before it loads or reads anything: limits, and what is
/// inherited. No core, nothing to write to files, `processor_seconds` of processors (0: without end),
/// few descriptors and none but those of child.h, 4 GiB of addresses; no new privileges, no other process of
/// the user may attach or read; no preference over others when memory is short.
/// Throws kiroku::Error where the kernel refuses: then nothing may be decoded.
void limit_process(unsigned processor_seconds);

/// From now on, for all threads and for good: a system call that is not on the list kills the process
/// (SIGSYS). Paths, where libraries look for what they can do without, are refused with EACCES. No file can
/// be opened, no program executed, no process started, looked at or signalled, no memory made executable,
/// and but for kNetwork and kServer no socket made. Throws kiroku::Error where the kernel refuses.
///
/// Programs with sanitizers: what is not on the list is refused with EPERM instead, because a sanitizer's own
/// threads and reports need more calls than can be named.
void close_box(BoxNeeds needs);

}  // namespace kiroku::media
