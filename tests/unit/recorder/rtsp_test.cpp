// Cameras on the network, through libavformat's own client.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/source/source.h"
#include "tests/support/recording.h"
#include "tests/support/rtsp_camera.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::RecorderBench;
using test::RtspCamera;
using testing::HasSubstr;
using testing::IsEmpty;

class RtspTest : public testing::Test {
 protected:
  /// Pictures of 64x48, 20 a second, in an MPEG transport stream.
  [[nodiscard]] Bytes film() const {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20&speed=max")};
    options.duration = 10s;
    return bench.record(options).joined("room");
  }
  [[nodiscard]] RtspCamera::Options camera(std::set<std::string> transports) const {
    RtspCamera::Options options;
    options.film = film();
    options.transports = std::move(transports);
    return options;
  }
  static std::unique_ptr<Source> open(const std::string& text, const CaseClock& clock) {
    OpeningTerms terms;
    terms.patience = 30s;
    return open_source(parse_source_address(text), clock, terms);
  }
  static void expect_pictures(Source& source, int count) {
    EXPECT_EQ(source.format().to_string(), "64x48 yuv420p");
    for (int i = 0; i < count; ++i) ASSERT_TRUE(source.read().has_value());
  }

  const RecorderBench bench;
  const CaseClock clock;
};

TEST_F(RtspTest, ComesOverTcpWhereACameraOffersIt) {
  const RtspCamera served(camera({"tcp", "udp"}));
  const auto source = open("rtsp://" + served.host() + "/stream", clock);
  expect_pictures(*source, 5);
  EXPECT_GT(served.sent("tcp"), 0U);
  EXPECT_EQ(served.sent("udp"), 0U);
  EXPECT_EQ(source->remark(), "");
}

TEST_F(RtspTest, ComesOverUdpWhereACameraOffersNoTcp) {
  const RtspCamera served(camera({"udp"}));
  const std::string address = "rtsp://" + served.host() + "/stream";
  const auto source = open(address, clock);
  expect_pictures(*source, 5);
  EXPECT_GT(served.sent("udp"), 0U);
  EXPECT_EQ(source->remark(),
            "source '" + address +
                "' comes over UDP, where what the network loses is not sent again: its server "
                "offers no TCP");
}

TEST_F(RtspTest, TheAddressChoosesTheTransport) {
  const RtspCamera served(camera({"tcp", "udp"}));
  const auto source = open("rtsp+udp://" + served.host() + "/stream", clock);
  expect_pictures(*source, 5);
  EXPECT_GT(served.sent("udp"), 0U);
  EXPECT_EQ(served.sent("tcp"), 0U);
  EXPECT_EQ(source->remark(), "");
}

TEST_F(RtspTest, ATransportThatIsNotOfferedIsRefusedByName) {
  const RtspCamera served(camera({"udp"}));
  try {
    open("rtsp+tcp://" + served.host() + "/stream", clock);
    FAIL() << "it was opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("its server does not offer RTSP over TCP"));
  }
  const RtspCamera none(camera({}));
  try {
    open("rtsp://" + none.host() + "/stream", clock);
    FAIL() << "it was opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("its server does not offer RTSP over TCP or UDP or multicast"));
  }
}

TEST_F(RtspTest, StatesPicturesThatTheNetworkLost) {
  RtspCamera::Options losing = camera({"udp"});
  losing.lost = [](std::uint64_t number) { return number % 5 == 4; };
  const RtspCamera served(std::move(losing));
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "rtsp+udp://" + served.host() + "/stream")};
  Session session(std::move(options));
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams[0].dropped >= 20) session.stop();
  });
  EXPECT_THAT(result.last.streams[0].input, HasSubstr("64x48 yuv420p, 20 a second, RTSP over UDP"));
  const test::RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  std::uint64_t dropped = 0;
  for (const archive::SegmentEntry& segment : recorded.segments("room")) dropped += segment.dropped;
  EXPECT_GE(dropped, 10U);
  ASSERT_THAT(recorded.gaps("room"), testing::Not(IsEmpty()));
  for (const archive::GapEntry& gap : recorded.gaps("room"))
    EXPECT_EQ(gap.cause, archive::GapCause::kSignalLost);
}

TEST_F(RtspTest, StatesNoLossWhereNothingIsLost) {
  // The film's end is followed by its beginning, which is a gap: it must not be reached before the stop.
  RtspCamera::Options slow = camera({"tcp"});
  slow.interval = 50ms;
  const RtspCamera served(std::move(slow));
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "rtsp://" + served.host() + "/stream")};
  Session session(std::move(options));
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams[0].frames >= 40) session.stop();
  });
  EXPECT_EQ(result.last.streams[0].dropped, 0U);
  EXPECT_THAT(bench.read(result.folder).gaps_but_overload("room"), IsEmpty());
}

}  // namespace
}  // namespace kiroku::recorder
