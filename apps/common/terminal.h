// What the programs ask of the terminal: is there one, how wide, colours, a passphrase. Functions are for the
// main thread.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "crypto/secret.h"

namespace kiroku::apps {

bool output_is_terminal();  // standard output
bool errors_are_terminal();
/// Columns of the terminal behind standard error; 80 where unknown.
std::size_t terminal_width();

enum class Colour { kGreen, kYellow, kRed };
/// Bold and coloured for standard output if that is a terminal that can and NO_COLOR (no-color.org) is unset;
/// else as it is.
std::string paint(Colour colour, std::string_view text);

/// $KIROKU_PASSPHRASE if set, else asked on the controlling terminal without showing it. Throws
/// kiroku::UsageError where there is neither, or the person cancels (Ctrl-C, Ctrl-D).
crypto::Secret ask_passphrase(const std::string& what_for);
/// The same, asked twice; refuses an empty one and two that differ.
crypto::Secret ask_new_passphrase(const std::string& what_for);

}  // namespace kiroku::apps
