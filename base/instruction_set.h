// Which vector instructions this machine has. Pure, thread-safe.
#pragma once

namespace kiroku {

enum class InstructionSet {
  kBaseline,
  kAvx2,    // with FMA
  kAvx512,  // F, BW, DQ and VL
};

bool machine_has(InstructionSet set);
/// The widest that this machine has.
InstructionSet best_instruction_set();

}  // namespace kiroku
