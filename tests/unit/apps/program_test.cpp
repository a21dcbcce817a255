#include <array>
#include <filesystem>
#include <system_error>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/common/command_line.h"

namespace kiroku::apps {
namespace {

TEST(Program, TellsWhichPathAFileSystemErrorIsAbout) {
  Program program("kiroku", "records", "");
  program.root().add_command("look", "looks").on_run([]() -> int {
    throw std::filesystem::filesystem_error("status", "/there/round",
                                            std::make_error_code(std::errc::too_many_symbolic_link_levels));
  });
  testing::internal::CaptureStderr();
  const std::array<const char*, 2> words{"kiroku", "look"};
  EXPECT_EQ(program.run(static_cast<int>(words.size()), words.data()), kRefused);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "kiroku: cannot reach /there/round: Too many levels of symbolic links\n");
}

}  // namespace
}  // namespace kiroku::apps
