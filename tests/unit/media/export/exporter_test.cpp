#include "media/export/exporter.h"

#include <csignal>
#include <fstream>
#include <iterator>
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/age_file.h"
#include "media/transport_times.h"
#include "media/vital_sample.h"
#include "tests/support/child_processes.h"
#include "tests/support/forger.h"
#include "tests/support/media_maker.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

using test::RecordedStream;
using testing::HasSubstr;

std::string read_file(const std::filesystem::path& path) {
  std::ifstream input(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

std::string joined(const std::vector<Bytes>& pieces) {
  std::string text;
  for (const Bytes& piece : pieces) {
    text += text_of(piece);
  }
  return text;
}

VitalSample sample_at(std::int64_t time_ns, const std::string& code, double value) {
  VitalSample sample;
  sample.time_ns = time_ns;
  sample.code = code;
  sample.value = value;
  sample.unit = "/min";
  sample.source = "bed 4";
  return sample;
}

class ExporterTest : public testing::Test {
 protected:
  void record(const std::vector<RecordedStream>& streams) {
    case_ = test::record_case(folder_ / "archive", streams, reader_.recipients);
  }
  RecordedStream transport_stream(const test::FilmOptions& options = {}) {
    film_ = test::make_transport_stream(options);
    return {"endoscope", "video", "video/mp2t", film_,
            std::vector<std::uint64_t>(film_.size(), static_cast<std::uint64_t>(options.frames_per_segment))};
  }
  RecordedStream matroska(const std::string& codec, const test::FilmOptions& options = {}) {
    film_ = test::make_matroska(options, codec);
    return {"room", "video", "video/x-matroska", film_,
            std::vector<std::uint64_t>(film_.size(), static_cast<std::uint64_t>(options.frames_per_segment))};
  }
  ExportResult run(const std::string& stream, const std::string& output) {
    options_.stream = stream;
    options_.output = folder_ / output;
    return export_stream(archive::CaseReader::open(case_), reader_.identities, options_);
  }
  std::string refusal(const std::string& stream, const std::string& output) {
    try {
      run(stream, output);
    } catch (const Error& error) {
      EXPECT_FALSE(std::filesystem::exists(folder_ / output)) << "something was left behind";
      EXPECT_FALSE(std::filesystem::exists(folder_ / (output + ".part"))) << "something was left behind";
      return error.what();
    }
    return "";
  }
  std::filesystem::path segment_file(const std::string& name) const { return case_ / "segments" / name; }

  test::TemporaryFolder folder_;
  test::Reader reader_ = test::make_reader();
  std::filesystem::path case_;
  std::vector<Bytes> film_;
  ExportOptions options_;
};

TEST_F(ExporterTest, JoinsTransportStreamSegmentsByteForByte) {
  record({transport_stream()});
  const ExportResult result = run("endoscope", "film.ts");
  EXPECT_EQ(read_file(folder_ / "film.ts"), joined(film_));
  EXPECT_EQ(result.segments, 3U);
  EXPECT_EQ(result.frames, 75U);
  EXPECT_EQ(result.bytes, joined(film_).size());
  EXPECT_EQ(result.start_ns, 0);
  EXPECT_EQ(result.end_ns, 3'000'000'000);
  EXPECT_EQ(result.incomplete, 0U);
  EXPECT_EQ(test::decode_file(folder_ / "film.ts").size(), 75U);
}

TEST_F(ExporterTest, KeepsEveryPictureAndItsTimeInMatroskaAndMp4) {
  record({transport_stream({.gap_frames = 10, .sound = true})});
  run("endoscope", "film.ts");
  const auto pictures = test::decode_file(folder_ / "film.ts");
  ASSERT_EQ(pictures.size(), 75U);
  EXPECT_EQ(pictures[25].time_ms - pictures[24].time_ms, 11 * 40) << "the gap";
  for (const char* name : {"film.mkv", "film.mp4"}) {
    const ExportResult result = run("endoscope", name);
    EXPECT_EQ(result.frames, 75U);
    EXPECT_EQ(test::decode_file(folder_ / name), pictures) << name;
    EXPECT_EQ(result.bytes, std::filesystem::file_size(folder_ / name));
  }
}

TEST_F(ExporterTest, WhatWasRecordedIsDemuxedInABox) {
  record({transport_stream(), matroska("ffv1")});
  for (const auto& [stream, name] :
       {std::pair{"endoscope", "film.mkv"}, {"endoscope", "film.mp4"}, {"room", "room.mkv"}}) {
    bool is_boxed = false;
    options_.progress = [&](std::uint64_t, std::uint64_t) {
      for (const pid_t child : test::child_processes())
        is_boxed = is_boxed || test::line_of_process(child, "status", "Seccomp:") == "2";
    };
    run(stream, name);
    EXPECT_TRUE(is_boxed) << name;
  }
}

TEST_F(ExporterTest, ADecoderThatIsKilledLeavesNoFile) {
  record({transport_stream(), matroska("ffv1")});
  options_.progress = [](std::uint64_t, std::uint64_t) {
    for (const pid_t child : test::child_processes()) ::kill(child, SIGKILL);
  };
  EXPECT_THAT(refusal("endoscope", "film.mkv"), HasSubstr("stream 'endoscope'"));
  EXPECT_THAT(refusal("room", "room.mkv"), HasSubstr("stream 'room'"));
}

TEST_F(ExporterTest, JoinsMatroskaSegmentsWithoutTouchingAPicture) {
  for (const char* codec : {"ffv1", "rawvideo"}) {
    record({matroska(codec, {.gap_frames = 5})});
    options_.overwrite = true;
    EXPECT_EQ(run("room", "film.mkv").frames, 75U);
    const auto pictures = test::decode_file(folder_ / "film.mkv");
    ASSERT_EQ(pictures.size(), 75U) << codec;
    EXPECT_EQ(pictures[25].time_ms, 30 * 40) << codec;
    std::vector<test::Picture> one_by_one;
    for (std::size_t i = 0; i < film_.size(); ++i) {
      std::ofstream(folder_ / "one.mkv", std::ios::binary) << text_of(film_[i]);
      for (test::Picture picture : test::decode_file(folder_ / "one.mkv")) {
        picture.time_ms += static_cast<std::int64_t>(i) * 30 * 40;
        one_by_one.push_back(picture);
      }
    }
    EXPECT_EQ(pictures, one_by_one) << codec;
  }
}

TEST_F(ExporterTest, GivesTheSameBytesEachTime) {
  record({transport_stream({.sound = true})});
  for (const char* ending : {".mkv", ".mp4"}) {
    run("endoscope", std::string("a") + ending);
    run("endoscope", std::string("b") + ending);
    EXPECT_EQ(read_file(folder_ / (std::string("a") + ending)),
              read_file(folder_ / (std::string("b") + ending)));
  }
}

TEST_F(ExporterTest, CutsAtSegmentsAndSaysWhatItWrote) {
  record({transport_stream()});
  options_.from_ns = 1'500'000'000;
  options_.to_ns = 2'000'000'000;
  const ExportResult result = run("endoscope", "film.ts");
  Bytes second = film_[1];
  TransportTimes(-kTicksPerSecond, "film", {}).move(second);
  EXPECT_TRUE(read_file(folder_ / "film.ts") == text_of(second)) << "the file's time 0 is 1 s of the case";
  EXPECT_EQ(result.zero_ns, 1'000'000'000);
  EXPECT_EQ(result.start_ns, 1'000'000'000);
  EXPECT_EQ(result.end_ns, 2'000'000'000);
  EXPECT_EQ(run("endoscope", "film.mkv").frames, 25U);
  EXPECT_EQ(test::decode_file(folder_ / "film.mkv").size(), 25U);
  options_.from_ns = 3'000'000'000;
  options_.to_ns = INT64_MAX;
  EXPECT_EQ(refusal("endoscope", "none.ts"), "stream 'endoscope' has nothing recorded in that time");
}

TEST_F(ExporterTest, ReportsProgressUpToTheEnd) {
  record({transport_stream()});
  std::uint64_t last = 0, total = 0;
  options_.progress = [&](std::uint64_t done, std::uint64_t of) {
    EXPECT_GT(done, last);
    last = done;
    total = of;
  };
  run("endoscope", "film.mkv");
  EXPECT_EQ(last, total);
  EXPECT_GT(total, joined(film_).size());
}

TEST_F(ExporterTest, RefusesAFormThatDoesNotGoWithTheStream) {
  record({transport_stream(),
          matroska("ffv1"),
          {"vitals", "vitals", "application/jsonl", {{}}, {0}},
          {"events", "events", "application/jsonl", {{}}, {0}}});
  EXPECT_EQ(refusal("endoscope", "x.csv"),
            "stream 'endoscope' cannot be exported as 'x.csv'; its name must end in .ts, .mkv or .mp4");
  EXPECT_EQ(refusal("room", "x.ts"),
            "stream 'room' cannot be exported as 'x.ts'; its name must end in .mkv or .mp4");
  EXPECT_EQ(refusal("vitals", "x.mkv"),
            "stream 'vitals' cannot be exported as 'x.mkv'; its name must end in .jsonl or .csv");
  EXPECT_EQ(refusal("events", "x.csv"),
            "stream 'events' cannot be exported as 'x.csv'; its name must end in .jsonl");
  EXPECT_EQ(refusal("events", "x"), "stream 'events' cannot be exported as 'x'; its name must end in .jsonl");
  EXPECT_THAT(refusal("endoscope", "x.DCM"), HasSubstr("DICOM is not among the forms that are written here"));
  EXPECT_THAT(refusal("kitchen", "x.ts"), HasSubstr("no stream \"kitchen\""));
}

TEST_F(ExporterTest, RefusesAContainerThatCannotHoldTheCodec) {
  record({matroska("ffv1")});
  EXPECT_EQ(refusal("room", "x.mp4"), "MP4 (.mp4) cannot hold ffv1; export it as .mkv");
  record({matroska("rawvideo")});
  EXPECT_EQ(refusal("room", "x.mp4"), "MP4 (.mp4) cannot hold rawvideo; export it as .mkv");
}

TEST_F(ExporterTest, RefusesToJoinPicturesOfAnotherSize) {
  RecordedStream stream = matroska("ffv1");
  stream.segments[2] = test::make_matroska({.width = 128}, "ffv1")[2];
  record({stream});
  const std::string text = refusal("room", "film.mkv");
  EXPECT_THAT(text, HasSubstr("it changes from ffv1 96x64 yuv420p to ffv1 128x64 yuv420p"));
  EXPECT_THAT(text, HasSubstr("one by one (--from, --to)"));
  options_.to_ns = 2'000'000'000;
  EXPECT_EQ(run("room", "before.mkv").frames, 50U);
}

TEST_F(ExporterTest, RefusesASegmentThatIsNotWhatTheLedgerSays) {
  record({transport_stream()});
  const auto file = segment_file("endoscope/00000001.ts.age");
  std::string bytes = read_file(file);
  bytes[bytes.size() / 2] ^= 1;
  std::ofstream(file, std::ios::binary) << bytes;
  for (const char* name : {"film.ts", "film.mkv"}) {
    EXPECT_EQ(refusal("endoscope", name),
              "the segment file segments/endoscope/00000001.ts.age is not what the ledger says (its SHA-256 "
              "differs); run kiroku verify to see what else does not hold");
  }
  std::ofstream(file, std::ios::binary) << bytes << 'x';
  EXPECT_THAT(refusal("endoscope", "film.ts"), HasSubstr("it has " + std::to_string(bytes.size() + 1) +
                                                         " bytes, not " + std::to_string(bytes.size())));
  // What lies outside the damage can still be had.
  options_.to_ns = 1'000'000'000;
  EXPECT_EQ(run("endoscope", "film.ts").frames, 25U);
}

TEST_F(ExporterTest, RefusesASegmentThatAnotherFileStandsInFor) {
  record({transport_stream()});
  const auto file = segment_file("endoscope/00000001.ts.age");
  std::filesystem::rename(file, folder_ / "moved.age");
  std::filesystem::create_symlink(folder_ / "moved.age", file);
  EXPECT_THAT(refusal("endoscope", "film.ts"), HasSubstr("is a symbolic link"));
  std::filesystem::remove(file);
  EXPECT_THAT(refusal("endoscope", "film.ts"), HasSubstr("segments/endoscope/00000001.ts.age"));
}

// A forger waits until a segment was hashed, and puts another film in its place before it is decrypted.
TEST_F(ExporterTest, AFilmExchangedAfterItWasHashedDoesNotLeave) {
  record({transport_stream()});
  const auto file = segment_file("endoscope/00000002.ts.age");
  const std::string honest = test::bytes_in(file);
  const std::vector<std::pair<std::string, std::string>> forgeries{
      {"of the same length", test::sealed_anew(Bytes(film_[2].size()), reader_.recipients)},
      {"of another segment", test::sealed_anew(film_[0], reader_.recipients)},
      {"shorter", test::sealed_anew(Bytes(188), reader_.recipients)},
      {"longer", test::sealed_anew(Bytes(film_[2].size() + 188), reader_.recipients)},
      {"under the same key", test::resealed(honest, reader_.identities, film_[0])}};
  for (const char* output : {"film.ts", "film.mkv", "film.mp4"}) {
    for (const auto& [what, forgery] : forgeries) {
      test::write_into(file, honest);
      options_.progress = [&, &forged = forgery](std::uint64_t done, std::uint64_t total) {
        if (done == total) test::write_into(file, forged);
      };
      EXPECT_THAT(refusal("endoscope", output),
                  testing::AllOf(HasSubstr("segments/endoscope/00000002.ts.age"),
                                 HasSubstr("changed after it was hashed"), HasSubstr("Find out what writes")))
          << output << " " << what;
    }
  }
}

// Under the same key, which a reader of the case knows: decryption alone tells nothing.
TEST_F(ExporterTest, AFilmExchangedWhileItIsOpenedDoesNotLeave) {
  record({matroska("rawvideo", {.width = 320, .height = 240})});
  const auto file = segment_file("room/00000001.mkv.age");
  const std::string forgery = test::resealed(test::bytes_in(file), reader_.identities, film_[2]);
  int opened = 0;
  reader_.identities = test::observed(reader_.identities, [&] {
    if (++opened == 2) test::write_into(file, forgery);
  });
  EXPECT_THAT(refusal("room", "film.mkv"),
              HasSubstr("00000001.mkv.age of " + case_.string() + " changed after it was hashed"));
}

TEST_F(ExporterTest, WhatLeavesOfASmallFileIsWhatWasHashed) {
  record({transport_stream()});
  const auto file = segment_file("endoscope/00000001.ts.age");
  const std::string forgery = test::resealed(test::bytes_in(file), reader_.identities, film_[2]);
  int opened = 0;
  reader_.identities = test::observed(reader_.identities, [&] {
    if (++opened == 2) test::write_into(file, forgery);
  });
  run("endoscope", "film.ts");
  EXPECT_EQ(read_file(folder_ / "film.ts"), joined(film_));
  EXPECT_EQ(test::bytes_in(file), forgery) << "the forger was at work";
}

TEST_F(ExporterTest, LinesExchangedAfterTheyWereHashedDoNotLeave) {
  const std::string line = to_json_line(sample_at(1, "MDC_ECG_HEART_RATE", 60)) + "\n";
  const std::string other = to_json_line(sample_at(1, "MDC_ECG_HEART_RATE", 90)) + "\n";
  ASSERT_EQ(line.size(), other.size());
  record({{"vitals", "vitals", "application/jsonl", {to_bytes(line)}, {1}}});
  const auto file = segment_file("vitals/00000000.jsonl.age");
  const std::string honest = test::bytes_in(file);
  for (const char* output : {"vitals.jsonl", "vitals.csv"}) {
    options_.progress = [&](std::uint64_t, std::uint64_t) {
      test::write_into(file, test::sealed_anew(bytes_of(other), reader_.recipients));
    };
    EXPECT_THAT(refusal("vitals", output), HasSubstr("changed after it was hashed")) << output;
    test::write_into(file, honest);
  }
}

TEST_F(ExporterTest, SaysThatASegmentWasErased) {
  RecordedStream stream = transport_stream();
  stream.first_is_erased = true;
  record({stream});
  EXPECT_EQ(refusal("endoscope", "film.ts"),
            "the segment file segments/endoscope/00000000.ts.age was erased under the policy 'after 30 "
            "days'; choose "
            "a time without it (--from, --to)");
  options_.from_ns = 1'000'000'000;
  EXPECT_EQ(run("endoscope", "film.ts").frames, 50U);
}

TEST_F(ExporterTest, RefusesAnIdentityThatIsNoRecipient) {
  record({transport_stream()});
  reader_ = test::make_reader();
  EXPECT_THAT(refusal("endoscope", "film.ts"),
              HasSubstr("cannot open the segment file segments/endoscope/00000000"));
}

TEST_F(ExporterTest, LeavesAFileThatIsThereAloneUnlessTold) {
  record({transport_stream()});
  std::ofstream(folder_ / "film.ts") << "mine";
  EXPECT_THROW(run("endoscope", "film.ts"), UsageError);
  EXPECT_EQ(read_file(folder_ / "film.ts"), "mine");
  options_.overwrite = true;
  run("endoscope", "film.ts");
  EXPECT_EQ(read_file(folder_ / "film.ts"), joined(film_));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "film.ts.part"));
}

TEST_F(ExporterTest, WritesForItsOwnerAlone) {
  record({transport_stream()});
  run("endoscope", "film.ts");
  struct stat facts {};
  ASSERT_EQ(stat((folder_ / "film.ts").c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777U, 0600U);
}

TEST_F(ExporterTest, SaysSoWhenItCannotWrite) {
  record({transport_stream()});
  EXPECT_THAT(refusal("endoscope", "no/such/film.ts"), HasSubstr("No such file or directory"));
  std::filesystem::create_directory(folder_ / "folder.ts");
  options_.stream = "endoscope";
  options_.output = folder_ / "folder.ts";
  EXPECT_THROW(export_stream(archive::CaseReader::open(case_), reader_.identities, options_), UsageError);
}

TEST_F(ExporterTest, ExportsASegmentThatAPowerCutEnded) {
  // Long enough that whole chunks of 64 KiB are on the disk before the cut.
  const test::FilmOptions options{.width = 320, .height = 240, .frames_per_segment = 30, .segments = 2};
  for (const bool lossless : {false, true}) {
    RecordedStream stream = lossless ? matroska("ffv1", options) : transport_stream(options);
    stream.last_is_cut = true;
    record({stream});
    options_.overwrite = true;
    const std::string name = lossless ? "film.mkv" : "film.ts";
    const ExportResult result = run(stream.name, name);
    EXPECT_EQ(result.incomplete, 1U);
    const auto pictures = test::decode_file(folder_ / name);
    EXPECT_GT(pictures.size(), 30U) << name;
    EXPECT_LT(pictures.size(), 60U) << name;
    if (!lossless) {
      EXPECT_EQ(result.bytes % 188, 0U);
      EXPECT_TRUE(joined(film_).starts_with(read_file(folder_ / name)));
    }
  }
}

TEST_F(ExporterTest, JoinsLinesAsTheyWereRecorded) {
  const Bytes first = to_bytes("{\"time_ns\":1}\n{\"time_ns\":2}\n"), second = to_bytes("{\"time_ns\":3}\n");
  record({{"vitals", "vitals", "application/jsonl", {first, {}, second}, {2, 0, 1}}});
  EXPECT_EQ(run("vitals", "vitals.jsonl").frames, 3U);
  EXPECT_EQ(read_file(folder_ / "vitals.jsonl"), "{\"time_ns\":1}\n{\"time_ns\":2}\n{\"time_ns\":3}\n");
}

TEST_F(ExporterTest, SaysWhereSegmentsHoldEachOthersFilm) {
  RecordedStream stream = transport_stream({.segments = 4});
  std::swap(stream.segments[1], stream.segments[2]);
  record({stream});
  EXPECT_THAT(refusal("endoscope", "film.mkv"), HasSubstr("time stamps go back"));
}

TEST_F(ExporterTest, OfEventsTakesThoseToWhichTheLedgerCommits) {
  const auto line = [](const std::string& event) {
    return R"({"salt":")" + std::string(64, 'a') + R"(","event":")" + event + "\"}\n";
  };
  RecordedStream events{"events", "events", "application/jsonl", {}, {2, 2}};
  events.segments = {to_bytes(line("one") + line("cut")), to_bytes(line("two") + "x\n")};
  events.not_entered = {line("cut")};
  record({events});
  const ExportResult result = run("events", "events.jsonl");
  EXPECT_EQ(read_file(folder_ / "events.jsonl"), line("one") + line("two"));
  EXPECT_EQ(result.frames, 2U);
  EXPECT_EQ(result.left_out, 2U);
}

TEST_F(ExporterTest, DropsTheLineThatAPowerCutBroke) {
  std::string lines;
  while (lines.size() < 100'000) {
    lines +=
        to_json_line(sample_at(static_cast<std::int64_t>(lines.size()), "MDC_ECG_HEART_RATE", 72)) + "\n";
  }
  record({{"vitals", "vitals", "application/jsonl", {to_bytes(lines)}, {1}, true}});
  run("vitals", "vitals.jsonl");
  const std::string exported = read_file(folder_ / "vitals.jsonl");
  EXPECT_TRUE(lines.starts_with(exported));
  EXPECT_TRUE(exported.ends_with("}\n"));
  EXPECT_GT(exported.size(), 60'000U);
  EXPECT_GT(run("vitals", "vitals.csv").frames, 400U);
}

TEST_F(ExporterTest, TabulatesVitalSignsInOrderOfTime) {
  VitalSample wave = sample_at(400'000'000, "MDC_ECG_ELEC_POTL_II", 0);
  wave.value.reset();
  wave.rate_hz = 250;
  wave.values = {0.5, -0.25};
  wave.unit = "mV";
  wave.device_time = parse_utc("2026-08-05T09:15:03Z");
  VitalSample missing = sample_at(1'000'000'000, "a \"b\", c", 0);
  missing.value.reset();
  missing.quality = VitalQuality::kMissing;
  missing.device_time = parse_utc("2026-08-05T08:15:00Z");
  const std::string first = to_json_line(sample_at(394'000'000, "HR", 72)) + "\n" + to_json_line(wave) + "\n";
  const std::string second = to_json_line(missing) + "\n";
  record({{"vitals", "vitals", "application/jsonl", {to_bytes(first), to_bytes(second)}, {2, 1}}});
  EXPECT_EQ(run("vitals", "vitals.csv").frames, 3U);
  EXPECT_EQ(read_file(folder_ / "vitals.csv"),
            "time,code,value,unit,quality,source,since_start,device_time\n"
            "0.392,MDC_ECG_ELEC_POTL_II,0.5,mV,good,bed 4,0.392,\n"
            "0.394,HR,72,/min,good,bed 4,0.394,\n"
            "0.396,MDC_ECG_ELEC_POTL_II,-0.25,mV,good,bed 4,0.396,2026-08-05T09:15:03.000000Z\n"
            "1,\"a \"\"b\"\", c\",,/min,missing,bed 4,1,2026-08-05T08:15:00.000000Z\n");
}

// One stream from the start, one from 3 s on, of which every other second lacks: the same stretch gives the
// same time 0, and only times change.
TEST_F(ExporterTest, GivesEveryFormAndStreamOneTimeBase) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  RecordedStream first = transport_stream({.segments = 6, .sound = true});
  RecordedStream later = transport_stream({.gap_frames = 25, .sound = true});
  later.name = "room";
  later.starts_ns = {3 * kSecond, 5 * kSecond, 7 * kSecond};
  first.first_pts = {45'000, 135'000, 225'000, 315'000, 405'000, 495'000};
  later.first_pts = {45'000, 225'000, 405'000};
  const std::string line = to_json_line(sample_at(5 * kSecond, "HR", 72)) + "\n";
  RecordedStream vitals{"vitals", "vitals", "application/jsonl", {to_bytes(line)}, {1}};
  vitals.starts_ns = {5 * kSecond};
  record({first, later, vitals});
  std::vector<std::int64_t> told;
  options_.on_picture = [&](std::int64_t time_ns) { told.push_back(time_ns); };
  const auto times = [&](const std::string& stream, const std::string& output) {
    told.clear();
    const ExportResult result = run(stream, output);
    EXPECT_EQ(result.frames, told.size()) << output;
    return told;
  };
  for (const std::int64_t from_ns : {std::int64_t{0}, 3 * kSecond + 1}) {
    options_.from_ns = from_ns;
    options_.overwrite = true;
    const std::int64_t zero_ns = from_ns == 0 ? 0 : 3 * kSecond;
    EXPECT_EQ(export_zero_ns(archive::CaseReader::open(case_), from_ns, INT64_MAX), zero_ns);
    for (const char* ending : {".ts", ".mkv", ".mp4"}) {
      const auto endoscope = times("endoscope", std::string("endoscope") + ending);
      const auto room = times("room", std::string("room") + ending);
      ASSERT_EQ(room.size(), 75U) << ending;
      EXPECT_EQ(endoscope.front(), 0) << ending;
      EXPECT_EQ(room.front(), 3 * kSecond - zero_ns) << ending;
      EXPECT_EQ(room[25], 5 * kSecond - zero_ns) << ending << ": after the gap";
      EXPECT_EQ(room[50], 7 * kSecond - zero_ns) << ending;
    }
    run("vitals", "vitals.csv");
    EXPECT_THAT(read_file(folder_ / "vitals.csv"),
                HasSubstr("5,HR,72,/min,good,bed 4," + std::to_string((5 * kSecond - zero_ns) / kSecond)));
  }
  EXPECT_EQ(test::decode_file(folder_ / "room.ts"), test::decode_file(folder_ / "room.mkv"));
}

TEST_F(ExporterTest, TellsWhereThePicturesChangeTheirSize) {
  RecordedStream stream = matroska("ffv1");
  stream.segments[2] = test::make_matroska({.width = 128}, "ffv1")[2];
  record({stream});
  options_.stream = "room";
  options_.output = folder_ / "film.mkv";
  try {
    export_stream(archive::CaseReader::open(case_), reader_.identities, options_);
    FAIL() << "two sizes in one file";
  } catch (const FormatChanged& change) {
    EXPECT_EQ(change.at_ns(), 2'000'000'000);
  }
}

TEST_F(ExporterTest, NamesTheLineThatIsNoVitalSign) {
  const std::string line = to_json_line(sample_at(1, "HR", 72)) + "\n";
  record({{"vitals", "vitals", "application/jsonl", {to_bytes(line + "{}\n")}, {2}}});
  EXPECT_EQ(refusal("vitals", "x.csv"),
            "line 2 of segments/vitals/00000000.jsonl.age is no vital sign: time_ns is missing at column 3");
  record({{"vitals", "vitals", "application/jsonl", {to_bytes(line + "{")}, {2}}});
  EXPECT_EQ(refusal("vitals", "x.jsonl"), "line 2 of segments/vitals/00000000.jsonl.age has no line end");
}

TEST_F(ExporterTest, RefusesASegmentThatHoldsOtherMediaThanStated) {
  RecordedStream stream = transport_stream();
  stream.media = "video/x-matroska";
  record({stream});
  EXPECT_THAT(refusal("endoscope", "x.mkv"),
              HasSubstr("cannot read the media of segments/endoscope/00000000"));
}

}  // namespace
}  // namespace kiroku::media
