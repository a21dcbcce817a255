#include "media/inspection/inspector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/reading/case_reader.h"
#include "crypto/hashed_source.h"
#include "media/vital_sample.h"
#include "tests/support/forger.h"
#include "tests/support/media_maker.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

using test::RecordedStream;
using testing::HasSubstr;

class InspectorTest : public testing::Test {
 protected:
  /// What the inspector says of each segment of one stream.
  std::vector<std::string> inspect(const RecordedStream& stream) {
    const auto folder = test::record_case(folder_ / "archive", {stream}, reader_.recipients);
    const auto recording = archive::CaseReader::open(folder);
    const archive::SegmentInspector inspector = decoding_inspector();
    std::vector<std::string> said;
    for (const archive::SegmentEntry& entry : recording.segments(stream.name, 0, INT64_MAX)) {
      const auto sealed = crypto::open_file_source(folder / entry.file.file);
      said.push_back(
          inspector(recording.stream(stream.name), entry, *sealed, opener_.identities).value_or(""));
    }
    return said;
  }
  static RecordedStream film(std::vector<Bytes> segments, const std::string& media) {
    return {"room", "video", media, std::move(segments), {25, 25, 25}};
  }
  static RecordedStream vitals(const std::string& lines, std::uint64_t count) {
    return {"vitals", "vitals", "application/jsonl", {to_bytes(lines)}, {count}};
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  test::Reader opener_ = reader_;
};

const std::vector<std::string> kThreeGood = {"", "", ""};

TEST_F(InspectorTest, HasNothingToSayOfWholeSegments) {
  EXPECT_EQ(inspect(film(test::make_transport_stream({.sound = true}), "video/mp2t")), kThreeGood);
  EXPECT_EQ(inspect(film(test::make_matroska({}, "ffv1"), "video/x-matroska")), kThreeGood);
  EXPECT_EQ(inspect(film(test::make_matroska({}, "rawvideo"), "video/x-matroska")), kThreeGood);
}

TEST_F(InspectorTest, CountsPictures) {
  RecordedStream stream = film(test::make_transport_stream({}), "video/mp2t");
  stream.units[1] = 24;
  EXPECT_EQ(inspect(stream),
            (std::vector<std::string>{
                "", "segments/room/00000001.ts.age holds 25 frames, the ledger states 24", ""}));
}

TEST_F(InspectorTest, FindsAPictureThatDoesNotDecode) {
  RecordedStream stream = film(test::make_matroska({}, "ffv1"), "video/x-matroska");
  // Within the coded slices of a picture: FFV1's own checksum must tell.
  Bytes& damaged = stream.segments[1];
  damaged[damaged.size() / 2] ^= std::byte{0x10};
  const auto said = inspect(stream);
  EXPECT_EQ(said[0], "");
  EXPECT_THAT(said[1], testing::ContainsRegex(
                           "^picture [0-9]+ of segments/room/00000001.mkv.age is damaged: .*CRC mismatch"));
  EXPECT_EQ(said[2], "");
}

TEST_F(InspectorTest, FindsMediaThatIsSomethingElse) {
  EXPECT_THAT(
      inspect(film({to_bytes("no film"), {}, to_bytes(std::string(100'000, 'x'))}, "video/x-matroska")),
      testing::Each(HasSubstr("cannot read the media of segments/room/0000000")));
  EXPECT_THAT(inspect(film({to_bytes("no film"), {}, to_bytes(std::string(100'000, 'x'))}, "video/mp2t")),
              testing::Each(testing::Not("")));
}

TEST_F(InspectorTest, AcceptsASegmentThatAPowerCutEnded) {
  RecordedStream stream =
      film(test::make_matroska({.width = 320, .height = 240}, "ffv1"), "video/x-matroska");
  stream.last_is_cut = true;
  EXPECT_EQ(inspect(stream), kThreeGood);
}

TEST_F(InspectorTest, ReadsEveryVitalSign) {
  VitalSample sample;
  sample.code = "MDC_ECG_HEART_RATE";
  sample.value = 72;
  const std::string line = to_json_line(sample) + "\n";
  EXPECT_EQ(inspect(vitals(line + line, 2))[0], "");
  EXPECT_EQ(inspect(vitals("", 0))[0], "");
  EXPECT_EQ(inspect(vitals(line, 2))[0],
            "segments/vitals/00000000.jsonl.age holds 1 samples, the ledger states 2");
  EXPECT_EQ(inspect(vitals(line + "x\n", 2))[0],
            "line 2 of segments/vitals/00000000.jsonl.age is no vital sign: expected { at column 1");
  EXPECT_EQ(inspect(vitals(line + "{", 1))[0],
            "line 2 of segments/vitals/00000000.jsonl.age has no line end");
}

TEST_F(InspectorTest, ReadsEventsAsJsonObjects) {
  const auto events = [](const std::string& lines, std::uint64_t count) {
    return RecordedStream{"events", "events", "application/jsonl", {to_bytes(lines)}, {count}};
  };
  EXPECT_EQ(inspect(events("{\"kind\":\"mark\"}\n{}\n", 2))[0], "");
  EXPECT_EQ(inspect(events(" { \"kind\" : \"mark\" }\t\n", 1))[0], "");
  EXPECT_EQ(inspect(events("{}\n", 2))[0],
            "segments/events/00000000.jsonl.age holds 1 lines, the ledger states 2");
  for (const std::string line : {"[]", "1", "", "{\"a\":}", "{} {}"}) {
    EXPECT_EQ(inspect(events(line + "\n", 1))[0],
              "line 1 of segments/events/00000000.jsonl.age is no JSON object")
        << line;
  }
  EXPECT_NE(inspect(events(std::string(500'000, '{') + "\n", 1))[0], "")
      << "deep nesting must not exhaust the stack";
}

TEST_F(InspectorTest, SaysNothingOfASegmentThatChangesMeanwhile) {
  const auto folder = test::record_case(
      folder_ / "archive", {film(test::make_transport_stream({}), "video/mp2t")}, reader_.recipients);
  const auto recording = archive::CaseReader::open(folder);
  const auto entry = recording.segments("room", 0, INT64_MAX).at(0);
  const auto file = crypto::open_file_source(folder / entry.file.file);
  const crypto::HashedSource sealed(
      *file, std::make_shared<const crypto::HashTrail>(crypto::HashTrail::of(*file)), entry.file.file);
  test::write_into(folder / entry.file.file, test::sealed_anew({}, reader_.recipients));
  EXPECT_THROW((void)decoding_inspector()(recording.stream("room"), entry, sealed, opener_.identities),
               crypto::SourceChanged);
}

TEST_F(InspectorTest, TellsAnIdentityThatDoesNotFit) {
  opener_ = test::make_reader();
  EXPECT_NE(inspect(vitals("", 0))[0], "");
}

}  // namespace
}  // namespace kiroku::media
