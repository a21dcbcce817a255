// How well the codes of a display are heard (light/sound_finder.h) in a made-up theatre, after MPEG-1 layer
// II by the recorder's own encoder: shares of codes by their level beside talk; and false readings in sound
// that has none.
//   sound_bench [CODES=24]         what is read, of so many codes for each condition
//   sound_bench --false SECONDS    false readings in so long a theatre without codes, beside the ledger of a
//                                  recorder with eight streams
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <random>
#include <span>
#include <string>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
}

#include "archive/format/ledger_entry.h"
#include "light/ledger_lights.h"
#include "light/light_judge.h"
#include "light/sound_code.h"
#include "light/sound_finder.h"
#include "media/libav_handles.h"
#include "recorder/encoder/sound_encoder.h"
#include "tests/support/theatre_sound.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)
using test::Samples;

constexpr std::int64_t kBegin = 1'790'000'000;  // Unix time
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr int kPeriodSamples = light::SoundCoder::kPeriodSamples;
constexpr std::int64_t kPeriodNs = light::kSoundPeriodSeconds * kSecond;

/// A ledger that writes so many entries a second.
light::LedgerLights ledger_of(int seconds, int entries_a_second) {
  light::LedgerLights ledger;
  for (int i = 0; i < entries_a_second * (seconds + 10); ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::microseconds(kBegin * 1'000'000 + i * 1'000'000LL / entries_a_second)),
                i * kSecond / entries_a_second};
    entry.body = archive::ClockEntry{true, i, 0, 0, 0};
    ledger.add_line(archive::to_line(entry));
  }
  ledger.finish();
  return ledger;
}

/// The code of a second, of the lines that were there when it began.
std::uint64_t code_of(const light::LedgerLights& ledger, std::int64_t second, int entries_a_second) {
  for (const light::LedgerCode& code : ledger.codes_of(second, second))
    if (code.entries == static_cast<std::uint64_t>((second - kBegin) * entries_a_second + 1))
      return code.code;
  throw std::runtime_error("the ledger has no such code");
}

/// Coded and decoded as a segment's sound is.
Samples recorded(const Samples& sound) {
  const recorder::VideoProfile profile;
  recorder::SoundEncoder encoder({test::kTheatreRate, 1, AV_SAMPLE_FMT_S16}, profile);
  const media::Codec decoder(avcodec_alloc_context3(avcodec_find_decoder_by_name("mp2float")));
  media::require(avcodec_open2(decoder.get(), nullptr, nullptr), "cannot decode");
  const media::Frame frame = media::make_frame();
  Samples heard;
  const auto decode = [&](const std::vector<media::Packet>& packets) {
    for (const media::Packet& packet : packets) {
      media::require(avcodec_send_packet(decoder.get(), packet.get()), "cannot decode");
      while (avcodec_receive_frame(decoder.get(), frame.get()) >= 0) {
        const auto* const samples = reinterpret_cast<const float*>(frame->extended_data[0]);
        heard.insert(heard.end(), samples, samples + frame->nb_samples);
      }
    }
  };
  const std::vector<std::int16_t> samples = test::as_16_bit(sound);
  constexpr std::size_t kPiece = 4'800;
  for (std::size_t at = 0; at + kPiece <= samples.size(); at += kPiece) {
    media::Frame piece = media::make_frame();
    piece->nb_samples = kPiece;
    piece->format = AV_SAMPLE_FMT_S16;
    piece->sample_rate = test::kTheatreRate;
    av_channel_layout_default(&piece->ch_layout, 1);
    media::require(av_frame_get_buffer(piece.get(), 0), "cannot make sound");
    std::copy_n(samples.begin() + static_cast<std::ptrdiff_t>(at), kPiece,
                reinterpret_cast<std::int16_t*>(piece->data[0]));
    decode(encoder.encode(std::move(piece), static_cast<std::int64_t>(at) * kSecond / test::kTheatreRate));
  }
  decode(encoder.drain());
  heard.resize(sound.size());
  return heard;
}

struct Condition {
  const char* name = "";
  double talk = -1'000, beeps = -1'000, ventilation = -15;  // dB
};

/// The theatre's own sound.
Samples theatre(const Condition& condition, std::size_t samples, unsigned seed) {
  Samples sound = test::at_level(test::ventilation(samples, seed), condition.ventilation);
  constexpr double kNone = -500;
  if (condition.talk > kNone) test::add(sound, test::at_level(test::talk(samples, seed + 1), condition.talk));
  if (condition.beeps > kNone) test::add(sound, test::at_level(test::beeps(samples), condition.beeps));
  return sound;
}

/// Listens period by period, as a verifier does.
void listen(light::LightJudge& judge, light::SoundFinder& finder, const Samples& sound,
            std::int64_t first_period, int periods) {
  const std::vector<std::int16_t> samples = test::as_16_bit(test::thinned(sound));
  for (int period = 0; period < periods; ++period) {
    const std::int64_t number = first_period + period;
    const auto stretch =
        std::span(samples).subspan(static_cast<std::size_t>(period * light::SoundFinder::kPeriodSamples),
                                   2 * static_cast<std::size_t>(light::SoundFinder::kPeriodSamples));
    std::vector<light::TimedSighting> heard;
    for (const light::HeardCode& code : finder.read({number * light::SoundFinder::kPeriodSamples, stretch},
                                                    light::SoundFinder::kPeriodSamples))
      heard.push_back({code.sample * kSecond / light::SoundFinder::kRate, code.sighting});
    judge.hear(number * kPeriodNs, (number + 1) * kPeriodNs, heard);
  }
}

int read_rates(int codes) {
  constexpr int kEntries = 2;
  const light::SoundCoder coder;
  const light::LedgerLights ledger =
      ledger_of((codes + 2) * static_cast<int>(light::kSoundPeriodSeconds), kEntries);
  const std::array<Condition, 4> conditions{
      {{.name = "ventilation 15 dB below talk"},
       {.name = "the same, and talk", .talk = 0},
       {.name = "the same, and beeps as loud as talk", .talk = 0, .beeps = 0},
       {.name = "ventilation as loud as talk", .ventilation = 0}}};
  std::printf("%-38s %8s %8s %8s %8s %8s %8s\n", "condition", "level", "codes", "agree", "exact", "unread",
              "wrong");
  for (const Condition& condition : conditions) {
    for (const double level : {-20.0, -30.0, -35.0, -40.0, -45.0}) {
      light::LightJudge judge(ledger, light::kSoundPeriodSeconds);
      light::SoundFinder finder;
      // A minute at a time, with what is left of the last code behind it.
      constexpr int kTogether = 12;
      for (int period = 0; period < codes; period += kTogether) {
        const int periods = std::min(kTogether, codes - period);
        Samples sound(static_cast<std::size_t>((periods + 1) * kPeriodSamples), 0.0F);
        for (int i = 0; i < periods; ++i) {
          const std::uint64_t code =
              code_of(ledger, kBegin + (period + i) * light::kSoundPeriodSeconds, kEntries);
          test::add(sound, test::at_level(test::as_samples(coder.sound_of(code)), level),
                    static_cast<std::size_t>(i * kPeriodSamples + test::kTheatreRate / 5));
        }
        sound = test::in_a_room(test::of_a_crystal(sound, 100), 0.5, 1);
        test::add(sound, theatre(condition, sound.size(), static_cast<unsigned>(period + 7)));
        listen(judge, finder, recorded(sound), period, periods);
      }
      const light::LightReport report = judge.finish();
      std::printf("%-38s %8.0f %8lu %7.1f%% %7.1f%% %8lu %8lu\n", condition.name, level, report.seconds,
                  100.0 * static_cast<double>(report.agreeing) / static_cast<double>(report.seconds),
                  100.0 * static_cast<double>(report.exact) / static_cast<double>(report.seconds),
                  report.unread, report.old + report.foreign + report.beside_foreign);
      std::fflush(stdout);
    }
  }
  return 0;
}

int false_readings(int seconds) {
  constexpr int kEntries = 40;
  const int periods = seconds / static_cast<int>(light::kSoundPeriodSeconds);
  const light::LedgerLights ledger = ledger_of(seconds, kEntries);
  light::LightJudge judge(ledger, light::kSoundPeriodSeconds);
  light::SoundFinder finder;
  const auto begun = std::chrono::steady_clock::now();
  double listened_s = 0;
  constexpr int kTogether = 12;
  for (int period = 0; period < periods; period += kTogether) {
    const int now = std::min(kTogether, periods - period);
    const Samples sound =
        theatre({.talk = 0, .beeps = -6}, static_cast<std::size_t>((now + 1) * kPeriodSamples),
                static_cast<unsigned>(1'000 + period));
    const auto before = std::chrono::steady_clock::now();
    listen(judge, finder, sound, period, now);
    listened_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
  }
  const light::LightReport report = judge.finish();
  std::printf(
      "stretches %lu, seconds %d, false readings: agree %lu, old %lu, foreign %lu; listening took %.1f s of "
      "%.1f s\n",
      report.seconds, periods * static_cast<int>(light::kSoundPeriodSeconds), report.agreeing, report.old,
      report.foreign, listened_s,
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    media::silence_libav();
    if (argc == 3 && argv[1] == std::string("--false")) return false_readings(std::stoi(argv[2]));
    return read_rates(argc > 1 ? std::stoi(argv[1]) : 24);
  } catch (const std::exception& error) {
    std::cerr << "sound_bench: " << error.what() << "\n";
    return 2;
  }
}
