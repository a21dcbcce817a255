#include "recorder/daemon/kept_memory.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using Files = std::array<Descriptor, KeptMemory::kFiles>;

Files none() { return {Descriptor(), Descriptor()}; }

/// As another process is given them.
Files given_on(const KeptMemory& memory) {
  Files files = none();
  for (std::size_t i = 0; i < files.size(); ++i)
    files.at(i) = Descriptor(::fcntl(memory.descriptor(i), F_DUPFD_CLOEXEC, 0));
  return files;
}

/// As the next process reads it.
std::string text_in(const KeptMemory& memory) {
  const auto bytes = KeptMemory(given_on(memory)).take_earlier();
  return bytes ? std::string(text_of(*bytes)) : "nothing";
}

TEST(KeptMemory, HoldsWhatWasKeptLastForTheNextProcess) {
  KeptMemory first{none()};
  EXPECT_EQ(text_in(first), "nothing");
  first.keep(bytes_of("anna"));
  EXPECT_EQ(text_in(first), "anna");
  KeptMemory second{given_on(first)};
  EXPECT_EQ(second.take_earlier(), to_bytes("anna"));
  EXPECT_EQ(second.take_earlier(), std::nullopt) << "patients' data are not held twice";
  second.keep(bytes_of("anna, berta"));
  second.keep(bytes_of("berta"));
  EXPECT_EQ(text_in(KeptMemory{given_on(second)}), "berta");
  second.keep({});
  EXPECT_EQ(text_in(KeptMemory{given_on(second)}), "");
}

// Cut off while it was written, or anything else: what was kept before is there still.
TEST(KeptMemory, ADamagedFileGivesWayToTheOther) {
  for (const bool is_cut : {true, false}) {
    KeptMemory first{none()};
    first.keep(bytes_of("anna"));
    first.keep(bytes_of("berta"));
    Files files = given_on(first);
    // The first is kept in the second file, the next in the first.
    const int newest = files[0].number();
    if (is_cut) {
      ASSERT_EQ(::ftruncate(newest, 41), 0);
    } else {
      ASSERT_EQ(::pwrite(newest, "x", 1, 42), 1);
    }
    KeptMemory second{std::move(files)};
    EXPECT_EQ(text_in(second), "anna");
    second.keep(bytes_of("clara"));
    EXPECT_EQ(text_in(KeptMemory{given_on(second)}), "clara");
  }
}

TEST(KeptMemory, DescriptorsThatAreSomethingElseHoldNothing) {
  Files files{Descriptor(::open("/dev/null", O_RDWR | O_CLOEXEC)), Descriptor()};
  EXPECT_EQ(text_in(KeptMemory{std::move(files)}), "nothing");
}

}  // namespace
}  // namespace kiroku::recorder
