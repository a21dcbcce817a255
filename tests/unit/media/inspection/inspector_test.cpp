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

const std::vector<std::string> kThreeGood = {"", "", ""};

/// Of make_transport_stream()'s segments.
const std::vector<std::int64_t> kFirstStamps{45'000, 135'000, 225'000};

constexpr std::size_t kPacketBytes = 188;

/// With the packets of `beside` between its own, under identifiers that no table names.
Bytes with_packets_of(const Bytes& film, Bytes beside) {
  Bytes both = film;
  for (std::size_t at = 0; at < beside.size(); at += kPacketBytes) beside[at + 1] |= std::byte{0x02};
  both.insert(both.end(), beside.begin(), beside.end());
  return both;
}

/// Behind the header of a Matroska file, in an element that players pass over.
Bytes in_a_void(const Bytes& matroska, const Bytes& hidden) {
  const std::size_t header = 5 + (std::to_integer<std::size_t>(matroska[4]) & 0x7fU);
  Bytes all(matroska.begin(), matroska.begin() + static_cast<std::ptrdiff_t>(header));
  all.push_back(std::byte{0xec});
  for (int byte = 7; byte >= 0; --byte)
    all.push_back(static_cast<std::byte>(
        (byte == 7 ? 1U : hidden.size() >> (8U * static_cast<unsigned>(byte))) & 0xffU));
  all.insert(all.end(), hidden.begin(), hidden.end());
  all.insert(all.end(), matroska.begin() + static_cast<std::ptrdiff_t>(header), matroska.end());
  return all;
}

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
      const auto problem = inspector(recording.stream(stream.name), entry, *sealed, opener_.identities);
      said.push_back(problem ? (problem->is_late ? "late: " : "") + problem->text : "");
    }
    return said;
  }
  static RecordedStream film(std::vector<Bytes> segments, const std::string& media) {
    RecordedStream stream{"room", "video", media, std::move(segments), {25, 25, 25}};
    if (media == "video/mp2t") stream.first_pts = kFirstStamps;
    return stream;
  }
  static RecordedStream vitals(const std::string& lines, std::uint64_t count) {
    return {"vitals", "vitals", "application/jsonl", {to_bytes(lines)}, {count}};
  }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  test::Reader opener_ = reader_;
};

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

// What the ledger states of a segment is not stated of another one's film.
TEST_F(InspectorTest, ComparesTheFirstTimeStamp) {
  RecordedStream stream = film(test::make_transport_stream({}), "video/mp2t");
  std::swap(stream.segments[0], stream.segments[2]);
  const auto said = inspect(stream);
  EXPECT_EQ(
      said[0],
      "the first picture of segments/room/00000000.ts.age is stamped 225000, the ledger states 45000 (in "
      "units of 1/90000 s)");
  EXPECT_EQ(said[1], "");
  EXPECT_NE(said[2], "");
  stream = film(test::make_matroska({}, "ffv1"), "video/x-matroska");
  stream.first_pts = {0, 1'000, 2'001};
  EXPECT_THAT(inspect(stream)[2], HasSubstr("is stamped 2000, the ledger states 2001"));
  // Time stamps of MPEG-TS begin again after 26 hours, and what the ledger states goes on.
  stream = film(test::make_transport_stream({}), "video/mp2t");
  for (std::int64_t& stamp : stream.first_pts) stamp += std::int64_t{1} << 33;
  EXPECT_EQ(inspect(stream), kThreeGood);
}

TEST_F(InspectorTest, PicturesLastNoLongerThanTheirSegment) {
  // Slowed down to a picture in 0.1 s: what is stated to be a second lasts 2.4 s.
  RecordedStream stream = film(test::make_transport_stream({.rate = 10}), "video/mp2t");
  stream.first_pts.clear();
  for (std::int64_t i = 0; i < 3; ++i) stream.first_pts.push_back(45'000 + i * 225'000);
  EXPECT_EQ(
      inspect(stream)[1],
      "late: by their time stamps the pictures of segments/room/00000001.ts.age last 2.400000 s, by the "
      "ledger 1.000000 s");
}

TEST_F(InspectorTest, OneFileHoldsOneFilm) {
  const std::vector<Bytes> films = test::make_transport_stream({});
  const std::vector<Bytes> others = test::make_matroska({}, "ffv1");
  const auto first = [&](const Bytes& plaintext, const std::string& media) {
    RecordedStream stream = film(media == "video/mp2t" ? films : others, media);
    stream.segments[0] = plaintext;
    return inspect(stream)[0];
  };
  EXPECT_THAT(first(in_a_void(others[0], films[0]), "video/mp2t"),
              HasSubstr("is no MPEG transport stream: "));
  EXPECT_THAT(first(with_packets_of(films[0], films[1]), "video/mp2t"),
              HasSubstr("has 2 streams of pictures, 0 of sound and 0 of something else"));
  Bytes longer = films[0];
  longer.push_back(std::byte{0x47});
  EXPECT_THAT(first(longer, "video/mp2t"), HasSubstr("ends within a packet of 188 bytes"));
  EXPECT_THAT(first(in_a_void(others[0], films[0]), "video/x-matroska"),
              HasSubstr("is no Matroska of a recorder: it has an element at byte "));
  Bytes twice = others[0];
  twice.insert(twice.end(), others[1].begin(), others[1].end());
  EXPECT_THAT(first(twice, "video/x-matroska"), HasSubstr("is no Matroska of a recorder: it "));
}

TEST_F(InspectorTest, FindsMediaThatIsSomethingElse) {
  EXPECT_THAT(
      inspect(film({to_bytes("no film"), {}, to_bytes(std::string(100'000, 'x'))}, "video/x-matroska")),
      testing::Each(HasSubstr("is no Matroska of a recorder: it ")));
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

TEST_F(InspectorTest, VitalSignsAreOfTheirSegmentsTime) {
  VitalSample sample;
  sample.code = "MDC_ECG_HEART_RATE";
  sample.value = 72;
  sample.time_ns = 1'001'000'000;  // of a segment of a second; lines are right to a millisecond
  EXPECT_EQ(inspect(vitals(to_json_line(sample) + "\n", 1))[0], "");
  sample.time_ns = 1'001'000'001;
  EXPECT_EQ(
      inspect(vitals(to_json_line(sample) + "\n", 1))[0],
      "line 1 of segments/vitals/00000000.jsonl.age is of 1001000001 ns, the segment of 0 to 1000000000 "
      "ns");
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
