#include "recorder/vitals/mllp_framing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using testing::ElementsAre;

std::vector<std::string> events(const std::string& bytes, std::size_t piece, std::size_t longest = 1000) {
  MllpDeframer deframer(longest);
  std::vector<std::string> found;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    std::string_view rest = std::string_view(bytes).substr(at, piece);
    while (auto event = deframer.feed(rest)) {
      constexpr const char* kNames[] = {"message ", "stray ", "cut ", "long "};
      found.push_back(kNames[static_cast<int>(event->kind)] + event->text);
    }
    EXPECT_LE(deframer.partial().size(), longest);
  }
  return found;
}

TEST(Mllp, CutsMessagesOutOfAnyPieces) {
  const std::string bytes =
      mllp_frame("MSH|1") + "\r\n" + mllp_frame("MSH|2") + "\x0BMSH|3\x1C\x0BMSH|4\x1C\n" + "\x0B\x1C\r";
  for (std::size_t piece = 1; piece <= bytes.size(); ++piece) {
    EXPECT_THAT(events(bytes, piece),
                ElementsAre("message MSH|1", "message MSH|2", "message MSH|3", "message MSH|4", "message "))
        << piece;
  }
}

TEST(Mllp, TellsWhatIsOutsideOfFrames) {
  EXPECT_THAT(events("hello\r\x0B"
                     "MSH\x1C\r",
                     100),
              ElementsAre("stray hello\r", "message MSH"));
  EXPECT_THAT(events("\x1C\r", 100), ElementsAre("stray \x1C"));
  EXPECT_THAT(events("\x0B"
                     "MSH|1\x0BMSH|2\x1C\r",
                     100),
              ElementsAre("cut MSH|1", "message MSH|2"));
}

TEST(Mllp, DropsAMessageThatIsTooLongAndGoesOnWithTheNext) {
  const std::string bytes =
      mllp_frame(std::string(1001, 'x')) + mllp_frame("MSH|2") + mllp_frame(std::string(1000, 'y'));
  for (const std::size_t piece : {1U, 7U, 999U, 5000U}) {
    EXPECT_THAT(events(bytes, piece), ElementsAre("long " + std::string(200, 'x'), "message MSH|2",
                                                  "message " + std::string(1000, 'y')));
  }
}

}  // namespace
}  // namespace kiroku::recorder
