// Somebody got hold of the decoder: what the box still lets them do.
#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/build_paths.h"
#include "tests/support/process.h"

namespace kiroku::test {
namespace {

constexpr bool kSanitized = !std::string_view(KIROKU_SANITIZERS).empty();
constexpr int kDone = 0, kRefused = 10, kKilled = 128 + SIGSYS;

ProcessResult probe(const std::string& needs, const std::string& call) {
  Process::Options options;
  options.command = {built_file("box_probe"), needs, call};
  return run_process(options);
}
int try_to(const std::string& needs, const std::string& call) { return probe(needs, call).status; }

/// Refused either way; under sanitizers the filter refuses what it otherwise kills for (sandbox.h).
void expect_stopped(const std::string& needs, const std::string& call) {
  const int status = try_to(needs, call);
  EXPECT_THAT(status, testing::AnyOf(kKilled, kRefused)) << needs << ": " << call;
}

TEST(BoxAttack, WhatIsNotOnTheListEndsTheDecoder) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer's box refuses instead";
  for (const char* needs : {"nothing", "network", "device"}) {
    for (const char* call : {"ptrace",
                             "read of parent",
                             "signal",
                             "descriptor of parent",
                             "program",
                             "process",
                             "vfork",
                             "new process by clone",
                             "namespace",
                             "mount",
                             "unlink",
                             "mkdir",
                             "chmod",
                             "raw socket",
                             "executable memory",
                             "making memory executable",
                             "limit",
                             "dumpable",
                             "another filter",
                             "bpf",
                             "perf",
                             "io_uring",
                             "userfaultfd",
                             "keys",
                             "terminal",
                             "uid"}) {
      EXPECT_EQ(try_to(needs, call), kKilled) << needs << ": " << call;
    }
  }
  for (const char* needs : {"nothing", "device"}) {
    for (const char* call : {"socket", "local socket", "netlink"})
      EXPECT_EQ(try_to(needs, call), kKilled) << needs << ": " << call;
  }
}

TEST(BoxAttack, NoWayLeadsToAFileAKeyOrAnotherProcess) {
  for (const char* needs : {"nothing", "network", "device"}) {
    for (const char* call :
         {"open", "create", "memory of parent", "ptrace", "read of parent", "signal", "descriptor of parent",
          "program", "process", "local socket", "netlink", "mount"})
      expect_stopped(needs, call);
  }
}

TEST(BoxAttack, PathsAreRefusedWithoutEndingTheDecoder) {
  // Libraries look for files that they can do without.
  for (const char* call : {"open", "create", "memory of parent"})
    EXPECT_EQ(try_to("nothing", call), kRefused);
  EXPECT_EQ(try_to("network", "netlink"), kRefused);
}

TEST(BoxAttack, TheNetworkIsThereForSourcesOfTheNetworkAlone) {
  EXPECT_EQ(try_to("network", "socket"), kDone);
  expect_stopped("nothing", "socket");
  expect_stopped("device", "socket");
}

// Who decodes a camera's pictures does not sit down at the port of a monitor that nobody waits for just then.
TEST(BoxAttack, NobodyConnectsToADecoderThatWasNotToldToWait) {
  EXPECT_EQ(try_to("server", "waiting for connections"), kDone);
  expect_stopped("network", "waiting for connections");
}

TEST(BoxAttack, ADecoderCanStillDecode) {
  for (const char* needs : {"nothing", "network", "device"}) {
    for (const char* call : {"thread", "memory", "clock", "name of its thread"})
      EXPECT_EQ(try_to(needs, call), kDone) << call;
  }
}

TEST(BoxAttack, MemoryHasAnEnd) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer's shadow takes terabytes of addresses";
  EXPECT_EQ(try_to("nothing", "much memory"), kRefused);
}

TEST(BoxAttack, NobodyMayLookIntoTheDecoder) {
  const ProcessResult self = probe("nothing", "self");
  EXPECT_EQ(self.out, "no_new_privs 1 dumpable 0 core 0\n");
}

}  // namespace
}  // namespace kiroku::test
