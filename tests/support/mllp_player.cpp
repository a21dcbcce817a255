// Plays a monitor: delivers HL7 messages to an MLLP server at a pace and says what became of them.
//
//   mllp_player HOST:PORT [--pace SECONDS] [--pipeline] [--trickle BYTES_A_SECOND] [--tls] FILE.hl7…
//   mllp_player HOST:PORT --waves 8x500x10      channels x Hz x seconds: one message a second, in real time
//
// Prints "sent 10, AA 10, AE 0, AR 0, wrong 0"; wrong are answers whose MSA-2 is not the MSH-10 that was
// sent, in order. Exit 0 if every message was answered rightly.
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <thread>
#include <vector>

#include "base/utc_time.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/hl7_time.h"
#include "tests/support/mllp_client.h"

namespace kiroku::test {
namespace {

struct Playing {
  std::string host;
  std::uint16_t port = 0;
  double pace_s = 0, trickle = 0;
  bool pipeline = false, tls = false;
  int channels = 0, rate_hz = 0, seconds = 0;
  std::vector<std::string> files;
};

bool parse_number(const std::string& text, auto& into) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), into);
  return error == std::errc() && end == text.data() + text.size();
}

bool parse(int count, char** words, Playing& playing) {
  std::vector<std::string> arguments(words + 1, words + count);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    const auto value = [&]() -> std::string { return i + 1 < arguments.size() ? arguments[++i] : ""; };
    if (word == "--pace") {
      if (!parse_number(value(), playing.pace_s)) return false;
    } else if (word == "--trickle") {
      if (!parse_number(value(), playing.trickle)) return false;
    } else if (word == "--pipeline") {
      playing.pipeline = true;
    } else if (word == "--tls") {
      playing.tls = true;
    } else if (word == "--waves") {
      if (std::sscanf(value().c_str(), "%dx%dx%d", &playing.channels, &playing.rate_hz, &playing.seconds) !=
          3) {
        return false;
      }
    } else if (playing.host.empty()) {
      const std::size_t colon = word.rfind(':');
      if (colon == std::string::npos || !parse_number(word.substr(colon + 1), playing.port)) return false;
      playing.host = word.substr(0, colon);
    } else {
      playing.files.push_back(word);
    }
  }
  return !playing.host.empty() && (playing.seconds > 0 || !playing.files.empty());
}

std::vector<std::string> messages_of(const std::vector<std::string>& files) {
  std::vector<std::string> messages;
  for (const std::string& file : files) {
    std::ifstream in(file, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    for (const std::string_view message : recorder::split_hl7_messages(bytes)) {
      messages.emplace_back(message);
    }
  }
  return messages;
}

/// One second of every channel, counted upward without a gap, so that a missing value shows.
std::string wave_message(const Playing& playing, int second, UtcTime now) {
  const std::string time = recorder::format_hl7_time(now);
  std::string text = "MSH|^~\\&|PLAYER^01^EUI-64||||" + time + "||ORU^R01^ORU_R01|W" +
                     std::to_string(second) +
                     "|P|2.6|||||||UNICODE UTF-8\rOBR|1||1|1^CONTINUOUS WAVEFORM^99|||" +
                     recorder::format_hl7_time(now - std::chrono::seconds(1)) + "|" + time + "\r";
  for (int channel = 0; channel < playing.channels; ++channel) {
    const std::string sub_id = "1.7." + std::to_string(channel + 1) + ".131330";
    text += "OBX|" + std::to_string(2 * channel + 1) + "|NA|131330^MDC_ECG_ELEC_POTL_II^MDC|" + sub_id + "|";
    for (int i = 0; i < playing.rate_hz; ++i) {
      text += (i == 0 ? "" : "^") + std::to_string((second * playing.rate_hz + i) % 30'000);
    }
    text += "|266418^MDC_DIM_MILLI_VOLT^MDC|||||R\rOBX|" + std::to_string(2 * channel + 2) +
            "|NM|0^MDC_ATTR_SAMP_RATE^MDC|" + sub_id + ".1|" + std::to_string(playing.rate_hz) +
            "|264640^MDC_DIM_HZ^MDC\r";
  }
  return text;
}

class Player {
 public:
  explicit Player(const Playing& playing) : playing_(playing), client_(connect(playing)) {}

  void play(const std::string& message) {
    const recorder::Hl7Parse parsed = recorder::parse_hl7_message(message);
    if (parsed.message && parsed.message->header().field(15).raw() == "NE" &&
        parsed.message->header().field(16).raw() == "NE") {
      ++sent_;  // asks for no answer
    } else {
      waiting_.push_back(parsed.message ? parsed.message->control_id() : "");
    }
    if (playing_.trickle > 0) {
      for (const char c : recorder::mllp_frame(message)) {
        client_.send(std::string(1, c));
        std::this_thread::sleep_for(std::chrono::duration<double>(1 / playing_.trickle));
      }
    } else {
      client_.send_message(message);
    }
    if (!playing_.pipeline) {
      hear();
    }
  }
  /// Waits for the answers that are still due.
  void hear() {
    for (const std::string& control_id : waiting_) {
      const auto answer = client_.receive(std::chrono::seconds(30));
      const recorder::Hl7Parse parsed = recorder::parse_hl7_message(answer.value_or(""));
      if (!parsed.message || parsed.message->segments().size() < 2 ||
          parsed.message->segments()[1].field(2).text() != control_id) {
        ++wrong_;
      } else {
        ++answers_[parsed.message->segments()[1].field(1).text()];
      }
    }
    sent_ += waiting_.size();
    waiting_.clear();
  }
  int finish() {
    hear();
    std::cout << "sent " << sent_ << ", AA " << answers_["AA"] << ", AE " << answers_["AE"] << ", AR "
              << answers_["AR"] << ", wrong " << wrong_ << std::endl;
    return wrong_ == 0 ? 0 : 1;
  }

 private:
  static MllpClient connect(const Playing& playing) {
    // The server may just be starting.
    for (int attempt = 0;; ++attempt) {
      try {
        return {playing.host, playing.port, "", playing.tls};
      } catch (const boost::system::system_error&) {
        if (attempt == 100) throw;
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
    }
  }

  Playing playing_;
  MllpClient client_;
  std::vector<std::string> waiting_;
  std::map<std::string, std::size_t> answers_;
  std::size_t sent_ = 0, wrong_ = 0;
};

int play(const Playing& playing) {
  Player player(playing);
  const auto begin = std::chrono::steady_clock::now();
  for (int second = 0; second < playing.seconds; ++second) {
    std::this_thread::sleep_until(begin + std::chrono::seconds(second + 1));
    player.play(wave_message(playing, second, utc_now()));
  }
  for (const std::string& message : messages_of(playing.files)) {
    player.play(message);
    std::this_thread::sleep_for(std::chrono::duration<double>(playing.pace_s));
  }
  return player.finish();
}

}  // namespace
}  // namespace kiroku::test

int main(int count, char** words) {
  kiroku::test::Playing playing;
  if (!kiroku::test::parse(count, words, playing)) {
    std::cerr << "mllp_player: give HOST:PORT and FILE.hl7…, or --waves CHANNELSxHZxSECONDS\n";
    return 2;
  }
  try {
    return kiroku::test::play(playing);
  } catch (const std::exception& error) {
    std::cerr << "mllp_player: " << error.what() << "\n";
    return 2;
  }
}
