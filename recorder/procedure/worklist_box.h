// Asking a worklist in a process of its own (media/box): DICOM comes over the network in the clear, and DCMTK
// reads it by recursion and in whatever memory it takes. Outside is ask_worklist() (worklist.h).
#pragma once

#include "recorder/procedure/worklist.h"

namespace kiroku::recorder {

/// Loads what a question needs of files: DCMTK's dictionary, the machine's time zone, character sets. Why it
/// cannot be asked without, or "". Not thread-safe.
std::string prepare_worklist_query();
/// One association, one C-FIND, in this process. `options.host` is an address. After
/// prepare_worklist_query().
WorklistAnswer query_worklist(const WorklistOptions& options, UtcTime now);

/// The inside of the box: what the program kiroku-decoder does as "worklist". Looks the host up, closes the
/// box, asks, answers, ends. The channel is where media/box/child.h says.
[[noreturn]] void run_worklist_box();

}  // namespace kiroku::recorder
