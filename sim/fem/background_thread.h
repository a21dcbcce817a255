// A thread whose work can wait: what is computed ahead, or for pictures.
#pragma once

namespace kiroku::sim {

/// Makes the calling thread give way to all others of ordinary priority: SCHED_BATCH, and a niceness of 10.
/// Whether the system did so; where not, the thread is as before. Thread-safe.
bool work_in_background();

}  // namespace kiroku::sim
