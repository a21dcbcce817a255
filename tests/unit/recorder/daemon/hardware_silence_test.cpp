// What is told of a device's key in hardware that does not sign.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "recorder/daemon/daemon.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(HardwareSilence, IsToldInStatusAndMetricsAsLongAsItLasts) {
  const test::TemporaryFolder folder;
  std::string why = "no TPM";
  DaemonOptions options;
  options.archive = folder.path();
  options.hardware_silent = [&why] { return why; };
  Daemon daemon(std::move(options));
  EXPECT_EQ(daemon.handle({{"do", "status"}})["hardware_silent"], "no TPM");
  EXPECT_THAT(daemon.metrics(), HasSubstr("\nkiroku_hardware_silent 1\n"));
  why.clear();
  EXPECT_EQ(daemon.handle({{"do", "status"}})["hardware_silent"], "");
  EXPECT_THAT(daemon.metrics(), HasSubstr("\nkiroku_hardware_silent 0\n"));
}

TEST(HardwareSilence, IsNoneWhereNobodyAsks) {
  const test::TemporaryFolder folder;
  DaemonOptions options;
  options.archive = folder.path();
  Daemon daemon(std::move(options));
  EXPECT_EQ(daemon.handle({{"do", "status"}})["hardware_silent"], "");
  EXPECT_THAT(daemon.metrics(), Not(HasSubstr("kiroku_hardware_silent")));
}

}  // namespace
}  // namespace kiroku::recorder
