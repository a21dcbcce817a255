// What a process that holds keys gives up about itself. Thread-safe.
#pragma once

namespace kiroku {

/// To be called first in main(), before a key or an identity is read: no other process of the same user can
/// attach to this one or read its memory (PR_SET_DUMPABLE, prctl(2)), a crash leaves no core (RLIMIT_CORE),
/// and no program that it starts gains rights by its file (no_new_privs). The last two are inherited by what
/// it starts. systemd's unit asks for the same; this holds without systemd, too. Does nothing where the
/// kernel refuses. Under the address sanitizer the process stays open to ptrace, by which the sanitizer looks
/// for leaks.
void harden_process();

}  // namespace kiroku
