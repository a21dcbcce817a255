#include "archive/verify/carried_on.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

constexpr const char* kCarriedOnCase = "20260805T091502Z-3f9c21ab";

OpenEntry open_with(const std::string& source) {
  OpenEntry open;
  open.streams.resize(2);
  open.streams[0].kind = "video";
  open.streams[0].name = "endoscope";
  open.streams[1].kind = open.streams[1].name = "events";
  open.streams[1].source = source;
  return open;
}

TEST(CarriedOn, IsReadBackAsItWasWritten) {
  const CarriedOn earlier{kCarriedOnCase, 412, crypto::sha256(bytes_of("root"))};
  const auto read = carried_on_by(open_with(source_carrying_on(earlier)));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->case_id, kCarriedOnCase);
  EXPECT_EQ(read->size, 412U);
  EXPECT_EQ(read->root, earlier.root);
  EXPECT_EQ(announced_by(reason_to_be_carried_on(kCarriedOnCase)), kCarriedOnCase);
}

TEST(CarriedOn, AnyOtherTextSaysNothing) {
  const std::string whole = source_carrying_on({kCarriedOnCase, 412, {}});
  for (const std::string& source :
       {std::string("operator"), std::string(), whole + "0", whole.substr(0, whole.size() - 1),
        std::string("operator; carries on case ../x, 412 entries, root ") + std::string(64, '0'),
        "operator; carries on case " + std::string(kCarriedOnCase) + ", 0 entries, root " +
            std::string(64, '0'),
        "operator; carries on case " + std::string(kCarriedOnCase) + ", -1 entries, root " +
            std::string(64, '0')}) {
    EXPECT_FALSE(carried_on_by(open_with(source))) << source;
  }
  for (const char* reason : {"", "recovered", "operator", "recovered; to be carried on as case ../x"}) {
    EXPECT_FALSE(announced_by(reason)) << reason;
  }
  // A camera's address is anybody's text.
  OpenEntry camera = open_with("operator");
  camera.streams[0].source = whole;
  EXPECT_FALSE(carried_on_by(camera));
}

}  // namespace
}  // namespace kiroku::archive
