// 'kiroku consent'. A function; one thread.
#pragma once

namespace kiroku::apps {

class Command;

/// Adds it to the program.
void add_consent_command(Command& program);

}  // namespace kiroku::apps
