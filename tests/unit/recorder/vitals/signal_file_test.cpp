// Readers of EDF, WFDB and .vital files.
#include <cmath>
#include <fstream>
#include <zlib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/vital_source.h"
#include "tests/support/shared_data.h"
#include "tests/support/signal_files.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using media::VitalNotice;
using media::VitalQuality;
using media::VitalText;
using test::EdfSignal;
using test::little_endian_16;
using test::packed_212;
using test::VitalPackets;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::string compressed(const std::string& bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

class SignalFileTest : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }
  std::vector<VitalLine> read(const std::string& name) {
    return read_path((folder_ / name).string() + "?zone=UTC");
  }
  std::vector<VitalLine> read_path(const std::string& address) {
    const auto source = open_vital_source(parse_source_address(address), clock_);
    std::vector<VitalLine> lines;
    std::int64_t last_ns = 0;
    while (auto line = source->next()) {
      EXPECT_GE(media::time_ns_of(*line), last_ns);
      last_ns = media::time_ns_of(*line);
      EXPECT_NO_THROW(media::to_json_line(*line));
      lines.push_back(std::move(*line));
    }
    return lines;
  }
  std::string refusal(const std::string& name) {
    try {
      read(name);
    } catch (const Error& error) {
      const std::string text = error.what();
      const std::string begin = "cannot read " + name + ": ";
      return text.starts_with(begin) ? text.substr(begin.size()) : text;
    }
    return "";
  }
  /// All values of one code, one after the other.
  static std::vector<double> values_of(const std::vector<VitalLine>& lines, const std::string& code) {
    std::vector<double> values;
    for (const VitalLine& line : lines) {
      if (const auto* const sample = std::get_if<VitalSample>(&line);
          sample != nullptr && sample->code == code) {
        values.insert(values.end(), sample->values.begin(), sample->values.end());
        if (sample->value) values.push_back(*sample->value);
      }
    }
    return values;
  }
  template <typename Line>
  static std::vector<Line> of(const std::vector<VitalLine>& lines) {
    std::vector<Line> found;
    for (const VitalLine& line : lines) {
      if (const auto* const one = std::get_if<Line>(&line)) found.push_back(*one);
    }
    return found;
  }
  static std::vector<std::string> notices(const std::vector<VitalLine>& lines) {
    std::vector<std::string> names;
    for (const VitalNotice& notice : of<VitalNotice>(lines)) names.push_back(notice.notice);
    return names;
  }

  test::TemporaryFolder folder_;
  CaseClock clock_;
};

const std::vector<EdfSignal> kSignals{{"ECG II", "mV", "-5", "5", "-1000", "1000", 4},
                                      {"Temp", "degC", "0", "50", "0", "500", 1}};

TEST_F(SignalFileTest, ReadsEdf) {
  write("a.edf", test::edf_header(kSignals, "2", "2") + little_endian_16({0, 200, -200, 1000, 370}) +
                     little_endian_16({1, 2, 3, 4, 371}));
  const auto lines = read("a.edf");
  EXPECT_THAT(notices(lines), IsEmpty());
  EXPECT_THAT(values_of(lines, "MDC_ECG_ELEC_POTL_II"), ElementsAre(0, 1, -1, 5, 0.005, 0.01, 0.015, 0.02));
  EXPECT_THAT(values_of(lines, "MDC_TEMP"), ElementsAre(37, 37.1));
  // In pieces of a second, stamped at their end.
  const auto samples = of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(6));
  EXPECT_EQ(
      media::to_json_line(samples[0]),
      R"({"time_ns":1000000000,"device_time":"2026-01-01T12:00:01.000000Z","code":"MDC_ECG_ELEC_POTL_II",)"
      R"("mdc":131330,"rate_hz":2,"values":[0,1],"unit":"mV","source":"a.edf","quality":"good"})");
  EXPECT_EQ(samples[2].time_ns, 2'000'000'000);
  EXPECT_EQ(samples[2].unit, "Cel");
  EXPECT_EQ(samples[2].rate_hz, 0.5);
}

TEST_F(SignalFileTest, ReadsAnnotationsAndGapsOfEdfPlus) {
  const std::vector<EdfSignal> signals{{"Resp", "", "-1", "1", "-32768", "32767", 2},
                                       {"EDF Annotations", "", "-1", "1", "-32768", "32767", 30}};
  const auto annotations = [](std::string text) {
    text.resize(60, '\0');
    return text;
  };
  using namespace std::string_literals;  // NOLINT(google-build-using-namespace)
  write("a.edf", test::edf_header(signals, "2", "1", "EDF+D") + little_endian_16({0, 0}) +
                     annotations("+0.5\x14\x14\0+0.7\x15"s + "2\x14" + "clip \xC3\xBC\x14\0rubbish\x14\0"s) +
                     little_endian_16({0, 0}) + annotations("+10.5\x14\x14\0"s));
  const auto lines = read("a.edf");
  const auto texts = of<VitalText>(lines);
  ASSERT_THAT(texts, SizeIs(1));
  EXPECT_EQ(texts[0].text, "clip \xC3\xBC [2 s]");
  EXPECT_EQ(texts[0].time_ns, 200'000'000);
  EXPECT_EQ(texts[0].device_time, parse_utc("2026-01-01T12:00:00.7Z"));
  const auto samples = of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(2));
  EXPECT_EQ(samples[0].time_ns, 1'000'000'000);
  EXPECT_EQ(samples[1].time_ns, 11'000'000'000);
  EXPECT_THAT(notices(lines), ElementsAre("annotation-unreadable"));
}

TEST_F(SignalFileTest, ReadsADamagedEdfAsFarAsItGoesAndSaysSo) {
  auto odd = kSignals;
  odd[0].digital_maximum = "-1000";
  odd[1].dimension = "furlong";
  std::string header = test::edf_header(odd, "5", "1");
  header.replace(168, 8, "99.99.99");
  write("a.edf", header + little_endian_16({1, 2, 3, 4, 5}) + "xyz");
  const auto lines = read("a.edf");
  EXPECT_THAT(notices(lines),
              ElementsAre("time-unreadable", "scale-unreadable", "unit-unknown", "file-length-differs"));
  EXPECT_THAT(values_of(lines, "MDC_ECG_ELEC_POTL_II"), ElementsAre(1, 2, 3, 4));
  write("b.edf", test::edf_header(kSignals, "0", "1"));
  EXPECT_THAT(of<VitalSample>(read("b.edf")), IsEmpty());
}

TEST_F(SignalFileTest, RefusesWhatIsNoEdfByName) {
  write("a.edf", "0");
  EXPECT_EQ(refusal("a.edf"), "it is shorter than the header of an EDF file");
  write("a.edf", std::string(300, 'x'));
  EXPECT_EQ(refusal("a.edf"), "it is no EDF file");
  write("a.edf",
        "\xFF"
        "BIOSEMI" +
            std::string(300, ' '));
  EXPECT_THAT(refusal("a.edf"), HasSubstr("BDF"));
  const std::string sound = test::edf_header(kSignals, "1", "1");
  const auto with = [&](std::size_t at, const std::string& text) {
    std::string changed = sound + little_endian_16({1, 2, 3, 4, 5});
    changed.replace(at, text.size(), text);
    write("a.edf", changed);
    return refusal("a.edf");
  };
  EXPECT_EQ(with(252, "0   "), "it states no number of signals from 1 to 512");
  EXPECT_EQ(with(252, "9999"), "it states no number of signals from 1 to 512");
  EXPECT_EQ(with(252, "9   "), "it ends within its header");
  EXPECT_EQ(with(244, "-1      "), "it states no duration of a record");
  EXPECT_EQ(with(244, "0       "), "it has signals, but its records last no time");
  EXPECT_EQ(with(256 + 2 * 216, "nan     "), "the signal 'ECG II' states no number of values in a record");
  EXPECT_EQ(with(256 + 2 * 216, "99999999"), "the signal 'ECG II' states no number of values in a record");
  EXPECT_EQ(with(256 + 2 * 216, "8000000 "), "");
}

TEST_F(SignalFileTest, ReadsWfdbInItsFormats) {
  write("a.hea",
        "# made for a test\na 2 4 6 12:00:00 01/01/2026\n"
        "a.dat 16 200(10)/mV 12 0 10 125 0 II\na.dat 16 2/mmHg 16 0 0 20 0 ABP\n");
  write("a.dat", little_endian_16({10, 0, 210, 10, -190, -32768, 10, 4, 30, 6, 55, 0}));
  const auto lines = read("a.hea");
  EXPECT_THAT(values_of(lines, "MDC_ECG_ELEC_POTL_II"), ElementsAre(0, 1, -1, 0, 0.1, 0.225));
  const auto pressure = values_of(lines, "MDC_PRESS_BLD_ART_ABP");
  ASSERT_THAT(pressure, SizeIs(6));
  EXPECT_TRUE(std::isnan(pressure[2]));
  EXPECT_EQ(pressure[3], 2);
  EXPECT_THAT(notices(lines), ElementsAre("checksum-differs"));  // of ABP, with its missing value
  EXPECT_EQ(of<VitalSample>(lines).back().device_time, parse_utc("2026-01-01T12:00:01.5Z"));

  // Several values a frame, skew, a prologue.
  write("b.hea",
        "b 3 2 4\nb.dat 212x2+1 1/mV 12 0 0 0 0 X\nb.dat 212:1 1 12 0 0 0 0 Y\nb.z 80 0 8 0 0 0 0 Z\n");
  write("b.dat", "?" + packed_212({1, 2, -1, 3, 4, -2, 5, 6, -3, 7, 2047, -2048}));
  write("b.z", std::string("\x80\x81\x7F\x00", 4));
  const auto odd = read("b.hea");
  EXPECT_THAT(values_of(odd, "X"), ElementsAre(1, 2, 3, 4, 5, 6, 7, 2047));
  const auto skewed = values_of(odd, "Y");
  ASSERT_THAT(skewed, SizeIs(2));  // the second block has none left
  EXPECT_THAT(skewed, ElementsAre(-2, -3));
  const auto raw = values_of(odd, "Z");
  ASSERT_THAT(raw, SizeIs(4));
  EXPECT_EQ(raw[1], 1);
  EXPECT_EQ(raw[2], -1);
  EXPECT_TRUE(std::isnan(raw[3]));
  EXPECT_THAT(notices(odd), testing::IsSupersetOf({"signal-skewed", "not-calibrated"}));

  for (const auto& [format, bytes] : std::vector<std::pair<std::string, std::string>>{
           {"61", std::string("\xFF\xFE\x01\x00", 4)},
           {"24", std::string("\xFE\xFF\xFF\x00\x01\x00", 6)},
           {"32", std::string("\xFE\xFF\xFF\xFF\x00\x01\x00\x00", 8)}}) {
    write("c.hea", "c 1 2 2\nc.dat " + format + " 1/V 16 0 0 0 0 X\n");
    write("c.dat", bytes);
    EXPECT_THAT(values_of(read("c.hea"), "X"), ElementsAre(-2, 256)) << format;
  }
}

TEST_F(SignalFileTest, RefusesWhatIsNoWfdbByName) {
  write("x.dat", "1234");
  const auto refused = [&](const std::string& header) {
    write("a.hea", header);
    return refusal("a.hea");
  };
  EXPECT_THAT(refused(""), HasSubstr("names 0 signals and promises 0"));
  EXPECT_THAT(refused("a/3 2 250\n"), HasSubstr("several segments"));
  EXPECT_THAT(refused("a 0\n"), HasSubstr("no number of signals"));
  EXPECT_THAT(refused("a 1 fast\nx.dat 16\n"), HasSubstr("no sampling frequency: 'fast'"));
  EXPECT_THAT(refused("a 1 250 many\nx.dat 16\n"), HasSubstr("no number of samples"));
  EXPECT_THAT(refused("a 2 250\nx.dat 16\n"), HasSubstr("names 1 signals and promises 2"));
  EXPECT_THAT(refused("a 1 250\n../x.dat 16\n"), HasSubstr("names no signal file of the record's folder"));
  EXPECT_THAT(refused("a 1 250\nx.dat 310\n"), HasSubstr("is of format 310"));
  EXPECT_THAT(refused("a 1 250\nx.dat 16y\n"), HasSubstr("states no format: '16y'"));
  EXPECT_THAT(refused("a 1 250\nx.dat 16 gain\n"), HasSubstr("states no gain"));
  EXPECT_THAT(refused("a 2 250\nx.dat 16\nx.dat 212\n"), HasSubstr("another format"));
  EXPECT_THAT(refused("a 1 250\nnowhere.dat 16\n"), HasSubstr("nowhere.dat"));
  write("a.hea", "a 1 250 100\nx.dat 16 1/mV 16 0 0 0 0 X\n");
  EXPECT_THAT(notices(read("a.hea")), ElementsAre("file-length-differs"));
}

TEST_F(SignalFileTest, ReadsARealWfdbRecordToTheLastValue) {
  KIROKU_NEEDS_SHARED_DATA("recording/vitals/03700181.hea");
  const auto lines = read_path(test::shared_data("recording/vitals/03700181.hea").string() + "?zone=UTC");
  // The sums in the header are right, so every number was unpacked as it was packed.
  EXPECT_THAT(notices(lines), ElementsAre("signal-skewed"));
  const auto ecg = values_of(lines, "MCL1");
  EXPECT_EQ(ecg.size(), 4U * 75'000);
  EXPECT_EQ(ecg[0], std::round(67 / 2963.77 * 1e7) / 1e7);
  const auto pressure = values_of(lines, "MDC_PRESS_BLD_ART_ABP");
  EXPECT_EQ(pressure.size(), 75'000U);
  EXPECT_NEAR(pressure[0], (-943 + 1605) / 12.84, 1e-4);
  EXPECT_EQ(of<VitalSample>(lines).front().device_time, parse_utc("1994-08-15T17:27:46Z"));
  EXPECT_EQ(of<VitalSample>(lines).back().time_ns, 600'000'000'000);
}

TEST_F(SignalFileTest, ReadsVitalFiles) {
  constexpr double kStart = 1'767'268'800;  // 2026-01-01T12:00:00Z
  VitalPackets file;
  file.device(1, "Solar8000");
  file.track(1, 2, 1, "HR", "/min", 0, 1, 0, 2, 1);
  file.track(2, 1, 5, "ART", "mmHg", 4, 0.5, 10, 4, 1);
  file.track(3, 5, 0, "EVENT", "", 0, 1, 0, 0, 0);
  file.track(4, 2, 1, "PLETH_HR", "bpm", 0, 1, 0, 2, 1);  // the same parameter again
  file.record(kStart + 3, 1, VitalPackets::raw(97.3F));
  file.record(kStart, 2, VitalPackets::raw(std::uint32_t{6}) + little_endian_16({0, 1, 2, 3, 4, 5}));
  file.record(kStart + 2, 3, VitalPackets::raw(std::uint32_t{0}) + VitalPackets::text("Intubation"));
  file.record(kStart + 1, 1, VitalPackets::raw(std::numeric_limits<float>::quiet_NaN()));
  file.record(kStart + 4, 4, VitalPackets::raw(80.F));
  write("a.vital", compressed(file.bytes()));
  const auto lines = read("a.vital");
  EXPECT_THAT(notices(lines), IsEmpty());
  std::vector<std::string> text;
  for (const VitalLine& line : lines) text.push_back(media::to_json_line(line));
  EXPECT_THAT(
      text,
      ElementsAre(
          R"({"time_ns":0,"device_time":"2026-01-01T12:00:01.000000Z","code":"MDC_PRESS_BLD_ART_ABP","mdc":150036,"rate_hz":4,"values":[10,10.5,11,11.5],"unit":"mm[Hg]","source":"a.vital/Solar8000","quality":"good"})",
          R"({"time_ns":0,"device_time":"2026-01-01T12:00:01.000000Z","code":"MDC_ECG_HEART_RATE","mdc":147842,"value":null,"unit":"/min","source":"a.vital/Solar8000","quality":"missing"})",
          R"({"time_ns":500000000,"device_time":"2026-01-01T12:00:01.500000Z","code":"MDC_PRESS_BLD_ART_ABP","mdc":150036,"rate_hz":4,"values":[12,12.5],"unit":"mm[Hg]","source":"a.vital/Solar8000","quality":"good"})",
          R"({"time_ns":1000000000,"kind":"text","device_time":"2026-01-01T12:00:02.000000Z","code":"EVENT","text":"Intubation","source":"a.vital"})",
          R"({"time_ns":2000000000,"device_time":"2026-01-01T12:00:03.000000Z","code":"MDC_ECG_HEART_RATE","mdc":147842,"value":97.3,"unit":"/min","source":"a.vital/Solar8000","quality":"good"})",
          R"({"time_ns":3000000000,"device_time":"2026-01-01T12:00:04.000000Z","code":"PLETH_HR","value":80,"unit":"/min","source":"a.vital/Solar8000","quality":"good"})"));
}

TEST_F(SignalFileTest, ReadsADamagedVitalFileAsFarAsItGoesAndSaysSo) {
  VitalPackets file;
  file.track(1, 2, 1, "HR", "furlong", 0, 1, 0, 0, 0);
  file.track(2, 1, 5, "W", "", 0, 1, 0, 0, 0);  // no rate
  file.track(3, 9, 1, "?", "", 0, 1, 0, 0, 0);
  file.packet(77, "?");
  file.record(1000, 1, VitalPackets::raw(1.F));
  file.record(1001, 9, VitalPackets::raw(1.F));
  file.record(1002, 2, VitalPackets::raw(std::uint32_t{1}) + "ab");
  file.record(1003, 1, "");
  file.record(1e9, 1, VitalPackets::raw(1.F));
  file.record(1004, 1, VitalPackets::raw(2.F));
  write("a.vital", compressed(file.bytes() + std::string("\x01\xFF\xFF\x00\x00", 5)));
  auto lines = read("a.vital");
  EXPECT_THAT(values_of(lines, "MDC_ECG_HEART_RATE"), ElementsAre(1, 2));
  EXPECT_THAT(notices(lines), ElementsAre("unit-unknown", "track-unknown", "file-cut", "packets-unknown",
                                          "records-left-out"));
  EXPECT_THAT(of<VitalNotice>(lines).back().text, HasSubstr("4 records"));

  const std::string packed = compressed(file.bytes());
  write("b.vital", packed.substr(0, packed.size() - 12));
  lines = read("b.vital");
  EXPECT_THAT(notices(lines), testing::Contains("file-cut"));
  // Two members of gzip, one after the other.
  write("c.vital", compressed(file.bytes().substr(0, 40)) + compressed(file.bytes().substr(40)));
  EXPECT_THAT(notices(read("c.vital")), testing::Not(testing::Contains("file-cut")));
  write("d.vital", "VITA");
  EXPECT_EQ(refusal("d.vital"), "it is no recording of Vital Recorder");
  write("e.vital", compressed("PK\x03\x04 something else"));
  EXPECT_EQ(refusal("e.vital"), "it is no recording of Vital Recorder");
}

TEST_F(SignalFileTest, RefusesWrongOptions) {
  write("a.edf", test::edf_header(kSignals, "1", "1") + little_endian_16({1, 2, 3, 4, 5}));
  EXPECT_THROW(read_path((folder_ / "a.edf").string() + "?zone=Mars"), UsageError);
  EXPECT_THROW(read_path((folder_ / "a.edf").string() + "?loop=1"), UsageError);
}

}  // namespace
}  // namespace kiroku::recorder
