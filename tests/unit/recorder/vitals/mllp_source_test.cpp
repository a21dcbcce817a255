#include "recorder/vitals/mllp_source.h"

#include <atomic>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/mllp_server.h"
#include "tests/support/client_authority.h"
#include "tests/support/mllp_client.h"
#include "tests/support/reserved_port.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using test::MllpClient;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

std::string message(int id, const std::string& value = "97") {
  return "MSH|^~\\&|MON||||20260101120000+0000||ORU^R01|" + std::to_string(id) +
         "|P|2.6\rOBX|1|NM|1^MDC_X^MDC|1|" + value + "\r";
}

/// A source read by a thread of its own, as a lane reads it.
class Running {
 public:
  explicit Running(const std::string& options = "", const std::string& scheme = "mllp")
      : port_(test::reserved_port()),
        source_(open_vital_source(
            parse_source_address(scheme + "://127.0.0.1:" + std::to_string(port_) + options), clock_)),
        thread_([this] { read(); }) {}
  ~Running() { finish(); }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::uint64_t refused() const { return source_->refused(); }
  [[nodiscard]] std::uint64_t elsewhere() const { return source_->elsewhere(); }
  std::vector<VitalLine> finish() {
    if (thread_.joinable()) {
      source_->interrupt();
      thread_.join();
    }
    return lines_;
  }

 private:
  void read() {
    std::int64_t floor_ns = 0;
    for (;;) {
      if (auto line = source_->next()) {
        EXPECT_GE(media::time_ns_of(*line), floor_ns);
        floor_ns = media::time_ns_of(*line);
        lines_.push_back(std::move(*line));
      } else if (const auto quiet = source_->quiet_until_ns()) {
        EXPECT_GE(*quiet, floor_ns);
        floor_ns = *quiet;
      } else {
        return;
      }
    }
  }
  CaseClock clock_;
  std::uint16_t port_;
  std::unique_ptr<VitalSource> source_;
  std::vector<VitalLine> lines_;
  std::thread thread_;
};

template <typename Line>
std::vector<Line> lines_of(const std::vector<VitalLine>& lines) {
  std::vector<Line> found;
  for (const VitalLine& line : lines) {
    if (const auto* const one = std::get_if<Line>(&line)) {
      found.push_back(*one);
    }
  }
  return found;
}

std::string acknowledged(MllpClient& client) {
  const auto answer = client.receive();
  const Hl7Parse parsed = parse_hl7_message(answer.value_or(""));
  if (!parsed.message || parsed.message->segments().size() != 2) {
    return "nothing";
  }
  const Hl7Segment& msa = parsed.message->segments()[1];
  return msa.field(1).text() + " " + msa.field(2).text();
}

TEST(MllpSource, RecordsAndAcknowledges) {
  Running running;
  MllpClient client("127.0.0.1", running.port());
  client.send_message(message(1));
  EXPECT_EQ(acknowledged(client), "AA 1");
  client.send_message("MSH|^~\\&|MON||||20260101||ADT^A01|2|P|2.6\r");
  EXPECT_EQ(acknowledged(client), "AR 2");
  const auto lines = running.finish();
  const auto samples = lines_of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(1));
  EXPECT_EQ(samples[0].source, "MON@127.0.0.1");
  EXPECT_THAT(lines_of<media::DeviceMessage>(lines), SizeIs(2));
}

TEST(MllpSource, TakesMessagesByteByByteAndManyAtOnce) {
  Running running;
  MllpClient slow("127.0.0.1", running.port());
  MllpClient fast("127.0.0.1", running.port());
  const std::string trickle = mllp_frame(message(1));
  ASSERT_LT(trickle.size(), 500U);
  std::string all;
  for (int i = 0; i < 500; ++i) {
    all += mllp_frame(message(i, std::to_string(i)));
  }
  fast.send(all);
  for (std::size_t i = 0; i < 500; ++i) {
    if (i < trickle.size()) slow.send(trickle.substr(i, 1));
    ASSERT_EQ(acknowledged(fast), "AA " + std::to_string(i));
  }
  EXPECT_EQ(acknowledged(slow), "AA 1");
  EXPECT_THAT(lines_of<VitalSample>(running.finish()), SizeIs(501));
}

TEST(MllpSource, RecordsWhatItAcknowledgedThoughTheEndIsAskedFor) {
  for (int round = 0; round < 20; ++round) {
    Running running;
    std::thread stopper;
    std::atomic<std::size_t> answered = 0;
    {
      MllpClient client("127.0.0.1", running.port());
      std::string all;
      for (int i = 0; i < 200; ++i) {
        all += mllp_frame(message(i, std::to_string(i)));
      }
      client.send(all);
      stopper = std::thread([&, round] {
        while (answered < static_cast<std::size_t>(10 * round)) std::this_thread::yield();
        running.finish();
      });
      while (acknowledged(client) != "nothing") {
        ++answered;
      }
    }
    stopper.join();
    EXPECT_GE(lines_of<VitalSample>(running.finish()).size(), answered.load());
  }
}

TEST(MllpSource, DropsARepeatedMessageButAcknowledgesIt) {
  Running running;
  MllpClient client("127.0.0.1", running.port());
  client.send_message(message(1));
  EXPECT_EQ(acknowledged(client), "AA 1");
  client.close();
  MllpClient again("127.0.0.1", running.port());  // as after a lost acknowledgement
  again.send_message(message(1));
  EXPECT_EQ(acknowledged(again), "AA 1");
  EXPECT_THAT(lines_of<VitalSample>(running.finish()), SizeIs(1));
}

TEST(MllpSource, SaysWhatBecameOfBrokenConnections) {
  Running running("?idle=1&connections=2");
  {
    MllpClient cut("127.0.0.1", running.port());
    cut.send("\x0BMSH|^~\\&|CUT");
  }
  MllpClient noisy("127.0.0.1", running.port());
  noisy.send(" \r\n" + mllp_frame("\x0BMSH") + "noise" + mllp_frame(message(3)));
  EXPECT_EQ(acknowledged(noisy), "AE ");
  EXPECT_EQ(acknowledged(noisy), "AA 3");
  MllpClient large("127.0.0.1", running.port());
  large.send("\x0B" + std::string((512U << 10) + 1, 'x') + "\x1C\r" + mllp_frame(message(4)));
  EXPECT_EQ(acknowledged(large), "AA 4");
  MllpClient third("127.0.0.1", running.port());
  EXPECT_FALSE(noisy.receive(std::chrono::seconds(5)));  // the idlest of two
  EXPECT_FALSE(large.receive(std::chrono::seconds(5)));  // silent for a second
  std::string said;
  for (const media::VitalNotice& notice : lines_of<media::VitalNotice>(running.finish())) {
    said += notice.notice + ": " + notice.text + " " + notice.source + "\n";
  }
  EXPECT_THAT(said,
              HasSubstr("connection-ended: the connection was closed: it ended within a message that began "
                        "with 'MSH|^~\\&|CUT' @127.0.0.1"));
  EXPECT_THAT(said, HasSubstr("bytes-outside-frame: bytes outside of a message were passed over: '?noise'"));
  EXPECT_THAT(said, HasSubstr("message-cut"));
  EXPECT_THAT(said, HasSubstr("message-too-long: a message longer than 512 KiB, which began with 'xxx"));
  EXPECT_THAT(said,
              HasSubstr("connection-ended: the connection was closed: it was the idlest when another came"));
  EXPECT_THAT(said, HasSubstr("was silent for long"));
}

/// The notices of a name: sentence and source, a line each.
std::string notices(const std::vector<VitalLine>& lines, const std::string& name) {
  std::string found;
  for (const media::VitalNotice& notice : lines_of<media::VitalNotice>(lines)) {
    if (notice.notice == name) found += notice.text + " " + notice.source + "\n";
  }
  return found;
}

TEST(MllpSource, StoresNothingOfAnAddressThatMayNotSend) {
  Running running("?allow=127.0.5.0/24,127.0.6.1");
  for (int i = 0; i < 5; ++i) {
    MllpClient stranger("127.0.0.1", running.port(), "127.0.7.1");
    EXPECT_FALSE(stranger.receive(std::chrono::seconds(5)));
  }
  for (const char* monitor : {"127.0.5.9", "127.0.6.1"}) {
    MllpClient client("127.0.0.1", running.port(), monitor);
    client.send_message(message(1));
    EXPECT_EQ(acknowledged(client), "AA 1") << monitor;
  }
  EXPECT_EQ(running.refused(), 5U);
  const auto lines = running.finish();
  EXPECT_EQ(lines_of<VitalSample>(lines).size(), 2U);
  EXPECT_EQ(notices(lines, "connection-refused"),
            "a connection was refused: this address may not send here @127.0.7.1\n"
            "a connection was refused: this address may not send here (2 times so far) @127.0.7.1\n"
            "a connection was refused: this address may not send here (4 times so far) @127.0.7.1\n");
}

TEST(MllpSource, StoresNothingOfASenderThatMayNotSend) {
  Running running("?sender=MON/OR1,ICU^42");
  MllpClient client("127.0.0.1", running.port());
  const auto from = [](const std::string& sender, int id) {
    return "MSH|^~\\&|" + sender + "|||20260101120000+0000||ORU^R01|" + std::to_string(id) +
           "|P|2.6\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|0\r";
  };
  client.send_message(from("STRANGER|OR1", 1));
  EXPECT_EQ(acknowledged(client), "AR 1");
  client.send_message(from("MON|OR2", 2));
  EXPECT_EQ(acknowledged(client), "AR 2");
  client.send_message(from("MON^00A0|OR1^X", 3));
  EXPECT_EQ(acknowledged(client), "AA 3");
  client.send_message(from("ICU^42|", 4));
  EXPECT_EQ(acknowledged(client), "AA 4");
  client.send_message(from("ICU^43|", 5));
  EXPECT_EQ(acknowledged(client), "AR 5");
  EXPECT_EQ(running.refused(), 3U);
  const auto lines = running.finish();
  const auto samples = lines_of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(2));
  EXPECT_EQ(samples[0].source, "MON^00A0/OR1@127.0.0.1");
  EXPECT_THAT(lines_of<media::DeviceMessage>(lines), SizeIs(2));
  EXPECT_THAT(notices(lines, "sender-refused"),
              HasSubstr("this sender's messages (MSH-3, MSH-4) are not taken here; 1 of it refused so far "
                        "STRANGER/OR1@127.0.0.1\n"));
}

TEST(MllpSource, StoresNothingOfOtherPlaces) {
  Running running("?locations=SURG^OR1,OR1");
  MllpClient gateway("127.0.0.1", running.port());
  const auto of_bed = [](const std::string& place, int id) {
    return "MSH|^~\\&|GATEWAY||||20260101120000+0000||ORU^R01|" + std::to_string(id) + "|P|2.6\rPV1||I|" +
           place + "\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|72\r";
  };
  for (int id = 1; id <= 6; ++id) {
    gateway.send_message(of_bed(id % 2 == 1 ? "SURG^OR1" : "ICU^BED9", id));
    EXPECT_EQ(acknowledged(gateway), "AA " + std::to_string(id)) << "the gateway goes on";
  }
  EXPECT_EQ(running.elsewhere(), 3U);
  EXPECT_EQ(running.refused(), 0U);
  const auto lines = running.finish();
  const auto samples = lines_of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(3));
  for (const VitalSample& sample : samples) EXPECT_EQ(sample.source, "GATEWAY[SURG^OR1]@127.0.0.1");
  EXPECT_THAT(lines_of<media::DeviceMessage>(lines), SizeIs(3));
  EXPECT_EQ(notices(lines, "several-beds"), "");
  for (const VitalLine& line : lines) EXPECT_THAT(media::to_json_line(line), Not(HasSubstr("BED9")));
}

TEST(MllpSource, IsNotShutToAMonitorByConnectionsThatSayNothing) {
  Running running("?connections=20&of_address=10");
  MllpClient monitor("127.0.0.1", running.port(), "127.0.5.1");
  monitor.send_message(message(1));
  EXPECT_EQ(acknowledged(monitor), "AA 1");
  std::vector<std::unique_ptr<MllpClient>> idle;
  for (int i = 0; i < 300; ++i) {
    idle.push_back(
        std::make_unique<MllpClient>("127.0.0.1", running.port(), "127.0.6." + std::to_string(1 + i % 60)));
  }
  MllpClient other("127.0.0.1", running.port(), "127.0.5.2");
  other.send_message(message(2));
  EXPECT_EQ(acknowledged(other), "AA 2");
  monitor.send_message(message(3));
  EXPECT_EQ(acknowledged(monitor), "AA 3") << "what delivers keeps its connection";
  EXPECT_FALSE(idle.front()->receive(std::chrono::seconds(5)));
  const auto lines = running.finish();
  EXPECT_EQ(lines_of<VitalSample>(lines).size(), 3U);
  // Beside two of each monitor, whose times are of another day.
  EXPECT_LE(lines_of<media::VitalNotice>(lines).size(), 60U * 3 + 2 * 2)
      << "nobody fills the record with their visits";
}

// An answer is no trust: what is refused makes nobody a monitor.
TEST(MllpSource, IsNotShutToAMonitorByConnectionsWhoseMessagesAreRefused) {
  Running running("?connections=8&of_address=2&sender=MON");
  MllpClient monitor("127.0.0.1", running.port(), "127.0.5.1");
  monitor.send_message(message(1));
  EXPECT_EQ(acknowledged(monitor), "AA 1");
  std::vector<std::unique_ptr<MllpClient>> strangers;
  for (int i = 0; i < 30; ++i) {
    strangers.push_back(
        std::make_unique<MllpClient>("127.0.0.1", running.port(), "127.0.6." + std::to_string(1 + i % 15)));
    MllpClient& stranger = *strangers.back();
    stranger.send_message(i % 2 == 0 ? "no HL7" : "MSH|^~\\&|OTHER||||2026||ORU^R01|9|P|2.6\r");
    EXPECT_TRUE(stranger.receive()) << i;
  }
  monitor.send_message(message(2));
  EXPECT_EQ(acknowledged(monitor), "AA 2") << "what delivers keeps its connection";
  EXPECT_EQ(lines_of<VitalSample>(running.finish()).size(), 2U);
}

TEST(MllpSource, OneAddressTakesFromItsOwnConnectionsAlone) {
  Running running("?connections=20&of_address=2");
  MllpClient other("127.0.0.1", running.port(), "127.0.5.1");
  MllpClient first("127.0.0.1", running.port(), "127.0.5.2");
  MllpClient second("127.0.0.1", running.port(), "127.0.5.2");
  MllpClient third("127.0.0.1", running.port(), "127.0.5.2");
  EXPECT_FALSE(first.receive(std::chrono::seconds(5)));
  for (MllpClient* client : {&other, &second, &third}) {
    client->send_message(message(1));
    EXPECT_EQ(acknowledged(*client), "AA 1");
  }
}

TEST(MllpSource, AsksForACertificateOfItsAuthorityWhereOneIsNamed) {
  const test::TemporaryFolder folder;
  const test::ClientAuthority authority(folder.path(), "authority");
  const test::ClientAuthority another(folder.path(), "another");
  const std::string server = authority.issue("server");
  Running running("?certificate=" + server + "&key=" + server + "&clients=" + authority.file(), "mllps");
  const auto sends = [&](const std::string& certificate) {
    try {
      MllpClient client("127.0.0.1", running.port(), "127.0.0.1", true, certificate);
      client.send_message(message(1));
      return acknowledged(client);
    } catch (const boost::system::system_error&) {
      return std::string("nothing");
    }
  };
  EXPECT_EQ(sends(""), "nothing");
  EXPECT_EQ(sends(another.issue("stranger")), "nothing");
  EXPECT_EQ(sends(authority.issue("monitor")), "AA 1");
  EXPECT_EQ(running.refused(), 2U);
  EXPECT_EQ(lines_of<VitalSample>(running.finish()).size(), 1U);
}

TEST(MllpSource, ListensToTheNetworkOnlyWhereItIsSaidWhoMaySend) {
  const CaseClock clock;
  const auto open = [&](const std::string& address) {
    return open_vital_source(parse_source_address(address), clock);
  };
  for (const char* address : {"mllp://0.0.0.0:0", "mllp://[::]:0", "mllp://:0"}) {
    try {
      open(address);
      FAIL() << address;
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("could be anybody on the network: say who may send with allow="));
    }
  }
  EXPECT_NO_THROW(open("mllp://0.0.0.0:0?allow=192.168.7.0/24"));
  EXPECT_NO_THROW(open("mllp://0.0.0.0:0?allow=any"));
  for (const char* address : {"mllp://127.0.0.1:0?allow=", "mllp://127.0.0.1:0?allow=192.168.7.1/24",
                              "mllp://127.0.0.1:0?allow=monitor.local",
                              "mllp://127.0.0.1:0?sender=", "mllp://127.0.0.1:0?sender=MON,",
                              "mllp://127.0.0.1:0?of_address=0", "mllp://127.0.0.1:0?clients=ca.pem"}) {
    EXPECT_THROW(open(address), UsageError) << address;
  }
}

TEST(MllpServer, OffersAMessageAgainWhereThereIsNoRoomForItYet) {
  std::atomic<int> offered = 0;
  MllpServer::Options options;
  options.address = "127.0.0.1";
  options.port = 0;
  MllpServer server(
      options,
      [&](std::string_view bytes, const std::string&) -> std::optional<MllpServer::Answer> {
        return ++offered < 5 ? std::nullopt : std::optional(MllpServer::Answer{"MSH|" + std::string(bytes)});
      },
      [](const std::string&, const std::string&, const std::string&) {});
  server.start();
  MllpClient client("127.0.0.1", server.port());
  client.send_message("x");
  EXPECT_EQ(client.receive(), "MSH|x");
  EXPECT_EQ(offered, 5);
  server.stop();
  EXPECT_FALSE(client.receive());
}

TEST(MllpSource, RefusesWhatItCannotListenOn) {
  const CaseClock clock;
  const auto open = [&](const std::string& address) {
    return open_vital_source(parse_source_address(address), clock);
  };
  const Running running;
  EXPECT_THROW(open("mllp://127.0.0.1:" + std::to_string(running.port())), UsageError);
  EXPECT_THROW(open("mllp://nowhere.invalid:2575"), UsageError);
  EXPECT_THROW(open("mllp://127.0.0.1:port"), UsageError);
  EXPECT_THROW(open("mllp://127.0.0.1:99999"), UsageError);
  EXPECT_THROW(open("mllp://127.0.0.1:0?zone=Mars"), UsageError);
  EXPECT_THROW(open("mllp://127.0.0.1:0?speed=max"), UsageError);
  EXPECT_THROW(open("mllps://127.0.0.1:0"), UsageError);
  EXPECT_THROW(open("mllps://127.0.0.1:0?certificate=/nowhere.pem"), UsageError);
  EXPECT_NO_THROW(open("mllp://[::1]:0"));
}

TEST(Hl7File, GivesItsMessagesByTheirOwnTime) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "monitor.hl7";
  std::ofstream(path, std::ios::binary)
      << "MSH|^~\\&|M||||20260101120000||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||1\r"
      << "MSH|^~\\&|M||||20260101120002.5||ORU^R01|2|P|2.6\rOBX|1|NM|1^MDC_X^MDC||2\r"
      << "MSH|^~\\&|M||||20260101110000||ORU^R01|3|P|2.6\rOBX|1|NM|1^MDC_X^MDC||3\r"
      << "MSH|^~\\&|M||||||ADT^A01|4|P|2.6\r";
  const CaseClock clock;
  const auto source = open_vital_source(parse_source_address(path.string() + "?zone=UTC"), clock);
  std::vector<VitalLine> lines;
  while (auto line = source->next()) {
    lines.push_back(*line);
  }
  const auto samples = lines_of<VitalSample>(lines);
  ASSERT_THAT(samples, SizeIs(3));
  EXPECT_EQ(samples[0].time_ns, 0);
  EXPECT_EQ(samples[1].time_ns, 2'500'000'000);
  EXPECT_EQ(samples[2].time_ns, 2'500'000'000);
  EXPECT_EQ(lines_of<media::DeviceMessage>(lines).size(), 4U);
  std::ofstream(path, std::ios::binary) << "no message";
  EXPECT_THROW(open_vital_source(parse_source_address(path.string()), clock), Error);
  std::ofstream(path, std::ios::binary) << "";
  EXPECT_THROW(open_vital_source(parse_source_address(path.string()), clock), Error);
}

}  // namespace
}  // namespace kiroku::recorder
