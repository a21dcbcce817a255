// What a report names of the machine as it runs now, so that two machines with one key are seen. Functions;
// thread-safe.
#pragma once

#include <filesystem>
#include <string>

namespace kiroku::fleet {

/// In memory, on every Linux machine; a unit with PrivateDevices has it, too.
inline constexpr const char* kMemoryFolder = "/dev/shm";

/// 32 hexadecimal digits: the same for every process that reports of this home, until the machine starts
/// anew. They follow from a secret that lies in `memory` alone, so that whoever copied the machine's disks
/// cannot name them. The first who asks makes it, for the owner of the home and nobody else.
///
/// Where `memory` is no file system in memory, or somebody else took the secret's name there, the digits
/// follow from the machine's boot identifier, which ledgers of cases hold.
std::string run_of_machine(const std::filesystem::path& home,
                           const std::filesystem::path& memory = kMemoryFolder);

}  // namespace kiroku::fleet
