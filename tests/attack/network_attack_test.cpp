// Somebody on the hospital's network, or with an account on the appliance, who wants to stop a recorder: by
// what monitors send and by its control socket.
#include <atomic>
#include <future>
#include <mutex>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <boost/asio.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/descriptor.h"
#include "base/foreign_json.h"
#include "media/vitals_table.h"
#include "recorder/clock/case_clock.h"
#include "recorder/control/control_client.h"
#include "recorder/daemon/control_server.h"
#include "recorder/procedure/worklist.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_charset.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/mllp_server.h"
#include "recorder/vitals/mllp_source.h"
#include "tests/support/client_authority.h"
#include "tests/support/mllp_client.h"
#include "tests/support/reserved_port.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/worklist_server.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using nlohmann::ordered_json;
using test::MllpClient;
using testing::HasSubstr;
using testing::SizeIs;

// --- the control socket ------------------------------------------------------------------------------------

class ControlAttack : public testing::Test {
 protected:
  /// As kirokud does: the subject is written out again.
  static ordered_json answer(const json& request) {
    if (const auto subject = request.find("subject"); subject != request.end()) {
      const json copy = *subject;
      return {{"bytes", copy.dump().size()}};
    }
    return {{"well", true}};
  }
  [[nodiscard]] Descriptor connect() const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    socket.string().copy(address.sun_path, sizeof address.sun_path - 1);
    Descriptor peer(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::connect(peer.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    return peer;
  }
  [[nodiscard]] std::string ask(const std::string& line) const {
    const Descriptor peer = connect();
    const std::string bytes = line + "\n";
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t count = ::send(peer.number(), bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (count <= 0) return "";
      sent += static_cast<std::size_t>(count);
    }
    std::string received;
    std::array<char, 4096> some{};
    while (!received.ends_with('\n')) {
      const ssize_t count = ::recv(peer.number(), some.data(), some.size(), 0);
      if (count <= 0) return received;
      received.append(some.data(), static_cast<std::size_t>(count));
    }
    return received;
  }
  test::TemporaryFolder folder;
  std::filesystem::path socket = folder / "s";
};

TEST_F(ControlAttack, ALineOfBracketsEndsNoRecorder) {
  const ControlServer server(socket, answer);
  for (const std::size_t depth : {100U, 1000U, 10'000U, 250'000U}) {
    const std::string opened(depth, '['), closed(depth, ']');
    std::string objects;
    for (std::size_t i = 0; i < depth / 8; ++i) objects += R"({"a":)";
    for (const std::string& line :
         {R"({"do":"start","subject":{"a":)" + opened + closed + "}}", opened, opened + closed,
          R"({"do":"start","subject":)" + objects + "1" + std::string(depth / 8, '}') + "}"}) {
      const std::string said = ask(line);
      if (!nests_too_deep(line)) continue;
      EXPECT_THAT(said, HasSubstr("\"ok\":false")) << depth;
    }
  }
  EXPECT_EQ(ask_recorder(socket, {{"do", "status"}})["well"], true);
}

TEST_F(ControlAttack, ConnectionsThatSayNothingShutNobodyOut) {
  const ControlServer server(socket, answer);
  std::vector<Descriptor> silent;
  for (int i = 0; i < 400; ++i) silent.push_back(connect());
  EXPECT_EQ(ask_recorder(socket, {{"do", "status"}}, 10s)["well"], true);
  // They take no descriptors of the recorder: most were let go.
  std::size_t closed = 0;
  for (const Descriptor& each : silent) {
    const timeval limit{.tv_sec = closed < 300 ? 5 : 0, .tv_usec = 1000};
    ::setsockopt(each.number(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    char byte = 0;
    closed += ::recv(each.number(), &byte, 1, 0) == 0 ? 1U : 0U;
  }
  EXPECT_GE(closed, 300U);
}

TEST_F(ControlAttack, HalfLinesAndAnswersThatNobodyTakesShutNobodyOut) {
  const ControlServer server(socket, answer);
  std::vector<Descriptor> hostile;
  const std::string half(900'000, 'x');
  const std::string questions = [] {
    std::string all;
    for (int i = 0; i < 20'000; ++i) all += "{\"do\":\"status\"}\n";
    return all;
  }();
  for (int i = 0; i < 100; ++i) {
    hostile.push_back(connect());
    const std::string& bytes = i % 2 == 0 ? half : questions;
    (void)::send(hostile.back().number(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  EXPECT_EQ(ask_recorder(socket, {{"do", "status"}}, 10s)["well"], true);
}

// --- monitors ----------------------------------------------------------------------------------------------

std::string message_of(const std::string& sender, const std::string& id, const std::string& observations,
                       const std::string& type = "ORU^R01") {
  return "MSH|^~\\&|" + sender + "||||20260101120000+0000||" + type + "|" + id + "|P|2.6\rOBR|1\r" +
         observations;
}

std::size_t bytes_of_lines(const std::vector<media::VitalLine>& lines) {
  std::size_t bytes = 0;
  for (const media::VitalLine& line : lines) bytes += media::to_json_line(line).size();
  return bytes;
}

TEST(MonitorAttack, ALongNameIsNotWrittenIntoThousandsOfLines) {
  std::string observations;
  for (int i = 0; i < 10'000; ++i) observations += "OBX||NM|X||" + std::to_string(i) + "\r";
  const std::string name(200'000, 'A');
  for (const std::string& message :
       {message_of(name, "1", observations), message_of("MON|" + name, "2", observations),
        message_of("MON", name, observations), message_of("MON", "3", observations, "ORU^" + name)}) {
    Hl7Vitals vitals(0min);
    const Hl7Vitals::Taken taken = vitals.take(message, 0, utc_now(), "10.1.2.3");
    EXPECT_EQ(taken.answer, "AE");
    EXPECT_LT(bytes_of_lines(taken.lines), 2 * message.size());
    EXPECT_THAT(media::to_json_line(taken.lines.front()), HasSubstr("OBX||NM|X||7"))
        << "what was sent is kept";
  }
}

TEST(MonitorAttack, LongNamesOfObservationsAreNotRemembered) {
  const std::string name(100'000, 'C');
  Hl7Vitals vitals(0min);
  for (const std::string& observation : {"OBX|1|NM|" + name + "|1|60", "OBX|1|NM|X|" + name + "|60",
                                         "OBX|1|NM|X|1|60|" + name, "OBX|" + name + "|NM|X|1|no number",
                                         "OBX|1|" + name + "|X|1|60", "OBX|1|NM|X|1|60||||||F|||" + name}) {
    const Hl7Vitals::Taken taken = vitals.take(
        message_of("MON", std::to_string(observation.size()) + observation.substr(0, 12), observation + "\r"),
        0, utc_now(), "");
    EXPECT_EQ(taken.answer, "AA");
    ASSERT_FALSE(taken.lines.empty());
    // The message itself is as long as it is; what is made of it is not.
    EXPECT_LT(bytes_of_lines({taken.lines.begin() + 1, taken.lines.end()}), 3000U)
        << observation.substr(0, 12);
  }
}

TEST(MonitorAttack, FramesWithoutAMessageFillNoRecord) {
  Hl7Vitals vitals(0min);
  std::size_t lines = 0;
  for (int i = 0; i < 100'000; ++i) {
    const Hl7Vitals::Taken taken = vitals.take(i % 2 == 0 ? "" : "X", 0, utc_now(), "10.1.2.3");
    EXPECT_EQ(taken.answer, "AE");
    EXPECT_FALSE(taken.acknowledgement.empty());
    lines += taken.lines.size();
  }
  EXPECT_GT(lines, 1000U);
  EXPECT_LT(lines, 3000U);
  EXPECT_EQ(vitals.take("X", 0, utc_now(), "10.1.2.4").lines.size(), 2U) << "of another they are";
}

TEST(MonitorAttack, BytesThatAreNoMessageFillNoRecord) {
  std::atomic<int> told = 0;
  MllpServer::Options options;
  options.address = "127.0.0.1";
  options.port = 0;
  MllpServer server(
      options, [](std::string_view, const std::string&) { return std::optional(MllpServer::Answer{"ACK"}); },
      [&](const std::string&, const std::string&, const std::string&) { ++told; });
  server.start();
  MllpClient client("127.0.0.1", server.port());
  client.send_message("MSH|");
  ASSERT_TRUE(client.receive());
  std::string strays;
  for (int i = 0; i < 50'000; ++i) strays += "x\x1C";
  strays += std::string(50'000, '\x0B');  // each is cut short by the next
  client.send(strays);                    // none of it is answered: the next answer comes behind all of it
  client.send_message("MSH|");
  ASSERT_TRUE(client.receive(60s));
  EXPECT_GT(told, 100);
  EXPECT_LT(told, 3000);
  server.stop();
}

// What fetch(…, {method: "POST", mode: "no-cors", body}) of a page in a browser sends, and others of the
// kind.
TEST(MonitorAttack, APageInABrowserDeliversNoMessage) {
  std::atomic<int> taken = 0;
  std::mutex mutex;
  std::string told;
  MllpServer::Options options;
  options.address = "127.0.0.1";
  options.port = 0;
  MllpServer server(
      options,
      [&](std::string_view, const std::string&) {
        ++taken;
        return std::optional(MllpServer::Answer{"ACK"});
      },
      [&](const std::string& name, const std::string& text, const std::string&) {
        const std::lock_guard guard(mutex);
        told += name + ": " + text + "\n";
      });
  server.start();
  const std::string message = mllp_frame("MSH|^~\\&|");
  for (const std::string& head :
       {std::string("POST / HTTP/1.1\r\nHost: 127.0.0.1:2575\r\nOrigin: http://evil.example\r\n\r\n"),
        std::string("\r\n PUT / HTTP/1.1\r\n\r\n"), std::string("\x16\x03\x01\x02", 4),
        std::string("MSH|^~\\&|\r"), std::string("\x1C\r"), std::string("x")}) {
    MllpClient page("127.0.0.1", server.port());
    page.send(head + message);
    EXPECT_FALSE(page.receive(10s)) << head;
  }
  EXPECT_EQ(taken, 0);
  MllpClient monitor("127.0.0.1", server.port());
  monitor.send("\r\n \t" + message + "noise" + message);
  EXPECT_TRUE(monitor.receive()) << "white space before the first message is none";
  EXPECT_TRUE(monitor.receive()) << "and what comes behind it is passed over";
  server.stop();
  EXPECT_EQ(taken, 2);
  EXPECT_THAT(told, HasSubstr("connection-ended: the connection was closed: it sent 'POST / HTTP/1.1"));
  EXPECT_THAT(told, HasSubstr("as a web page in a browser, or another HTTP client does"));
  EXPECT_THAT(told, HasSubstr("bytes-outside-frame"));
}

TEST(MonitorAttack, FramesWithoutAMessageWaitWhereTheRecorderIsSlow) {
  const CaseClock clock;
  const std::uint16_t port = test::reserved_port();
  const auto source =
      open_vital_source(parse_source_address("mllp://127.0.0.1:" + std::to_string(port)), clock);
  (void)source->next();  // listens from now on; nobody takes what comes
  MllpClient client("127.0.0.1", port);
  constexpr std::size_t kRounds = 200, kFrames = 1000;
  std::string frames;
  for (std::size_t i = 0; i < kFrames; ++i) frames += mllp_frame("MSH|^~\\&|");
  std::size_t acknowledged = 0;
  bool goes_on = true;
  for (std::size_t round = 0; round < kRounds && goes_on; ++round) {
    client.send(frames);
    for (std::size_t i = 0; i < kFrames && goes_on; ++i) {
      goes_on = client.receive(3s).has_value();
      acknowledged += goes_on ? 1U : 0U;
    }
  }
  EXPECT_GT(acknowledged, kFrames);
  EXPECT_LT(acknowledged, kRounds * kFrames / 2) << "all of it lies in memory";
  source->interrupt();
  while (source->next() || source->quiet_until_ns()) {
  }
}

TEST(MonitorAttack, ACharacterSetIsReadAlsoWhereNoFileCanBeOpened) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none{0, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Utf8Text text = hl7_text_as_utf8("M\xFCller", {});
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_EQ(text.text, "M\xC3\xBCller");
}

TEST(MonitorAttack, AMonitorThatAsksToResumeItsSessionIsServed) {
  const test::TemporaryFolder folder;
  const test::ClientAuthority authority(folder.path(), "monitors");
  const std::string monitor = authority.issue("monitor");
  MllpServer::Options options;
  options.address = "127.0.0.1";
  options.port = 0;
  options.certificate = options.key = authority.issue("recorder");
  options.clients = authority.file();
  MllpServer server(
      options, [](std::string_view, const std::string&) { return std::optional(MllpServer::Answer{"ACK"}); },
      [](const std::string&, const std::string&, const std::string&) {});
  server.start();
  namespace asio = boost::asio;
  for (const int version : {TLS1_2_VERSION, TLS1_3_VERSION}) {
    asio::io_context io;
    asio::ssl::context tls(asio::ssl::context::tls_client);
    tls.use_certificate_chain_file(monitor);
    tls.use_private_key_file(monitor, asio::ssl::context::pem);
    SSL_CTX_set_min_proto_version(tls.native_handle(), version);
    SSL_CTX_set_max_proto_version(tls.native_handle(), version);
    std::unique_ptr<SSL_SESSION, void (*)(SSL_SESSION*)> session(nullptr, SSL_SESSION_free);
    for (int round = 0; round < 3; ++round) {
      asio::ssl::stream<asio::ip::tcp::socket> stream(io, tls);
      if (session) SSL_set_session(stream.native_handle(), session.get());
      stream.next_layer().connect({asio::ip::make_address("127.0.0.1"), server.port()});
      boost::system::error_code failed;
      stream.handshake(asio::ssl::stream_base::client, failed);
      ASSERT_FALSE(failed) << version << " " << round << ": " << failed.message();
      asio::write(stream, asio::buffer(mllp_frame("MSH|")), failed);
      std::array<char, 16> answer{};
      const std::size_t count = stream.read_some(asio::buffer(answer), failed);
      EXPECT_GT(count, 0U) << version << " " << round << ": " << failed.message();
      session.reset(SSL_get1_session(stream.native_handle()));
    }
  }
  server.stop();
}

// Each handshake costs a signature, on the thread that takes the monitors' messages.
TEST(MonitorAttack, TlsConnectionsThatBringNoMessageAreSlowedDown) {
  const test::TemporaryFolder folder;
  const test::ClientAuthority authority(folder.path(), "monitors");
  MllpServer::Options options;
  options.address = "127.0.0.1";
  options.port = 0;
  options.allow_anybody = true;
  options.certificate = options.key = authority.issue("recorder");
  options.handshakes.free_failures = 4;
  options.handshakes.first_wait = options.handshakes.longest_wait = 1h;
  MllpServer server(
      options, [](std::string_view, const std::string&) { return std::optional(MllpServer::Answer{"ACK"}); },
      [](const std::string&, const std::string&, const std::string&) {});
  server.start();
  namespace asio = boost::asio;
  asio::io_context io;
  asio::ssl::context tls(asio::ssl::context::tls_client);
  /// Whether it came through the handshake, and if it brings a message, whether that was answered.
  const auto connect = [&](const char* from, bool brings_message) {
    asio::ssl::stream<asio::ip::tcp::socket> stream(io, tls);
    asio::ip::tcp::socket& socket = stream.next_layer();
    boost::system::error_code failed;
    socket.open(asio::ip::tcp::v4());
    socket.bind({asio::ip::make_address(from), 0});
    socket.connect({asio::ip::make_address("127.0.0.1"), server.port()});
    stream.handshake(asio::ssl::stream_base::client, failed);
    if (failed || !brings_message) return !failed;
    asio::write(stream, asio::buffer(mllp_frame("MSH|")), failed);
    std::array<char, 16> answer{};
    return stream.read_some(asio::buffer(answer), failed) > 0;
  };
  ASSERT_TRUE(connect("127.0.0.3", true));
  int served = 0;
  for (int i = 0; i < 100; ++i) served += connect("127.0.0.2", false) ? 1 : 0;
  // A connection counts when its end has reached the server, which the next ones need not wait for.
  EXPECT_LT(served, 60);
  EXPECT_GT(server.refused(), 0U);
  EXPECT_FALSE(connect("127.0.0.2", true));
  // A monitor of another address is served, and one that delivered waits for nothing.
  EXPECT_TRUE(connect("127.0.0.4", true));
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(connect("127.0.0.3", false));
  EXPECT_TRUE(connect("127.0.0.3", true));
  server.stop();
}

TEST(MonitorAttack, ATableHoldsNoFormula) {
  std::string table;
  media::VitalsTable writer([&](ByteView bytes) { table += text_of(bytes); }, 0);
  media::VitalSample sample;
  sample.code = "=HYPERLINK(\"http://192.0.2.1/\")";
  sample.unit = "@SUM(1)";
  sample.source = "+1";
  sample.value = -60;
  writer.add(sample);
  writer.finish();
  EXPECT_THAT(table, HasSubstr("0,\"'=HYPERLINK(\"\"http://192.0.2.1/\"\")\",-60,'@SUM(1),good,'+1,0,\n"));
}

// --- the worklist ------------------------------------------------------------------------------------------

/// A worklist that accepts an association, waits for the question, and then sends what no worklist does, or
/// steps that nobody asked for. Who is between the recorder and a worklist can do the same: DICOM goes in the
/// clear.
class HostileWorklist {
 public:
  enum class Answer { kNested, kEndless, kSilence, kSteps };
  /// One of `steps`, as it is sent: what stands in the item of the Scheduled Procedure Step Sequence, and the
  /// patient's number.
  struct Step {
    std::string patient, station, modality;
  };
  explicit HostileWorklist(Answer answer, std::vector<Step> steps = {})
      : answer_(answer),
        steps_(std::move(steps)),
        acceptor_(context_, {boost::asio::ip::make_address("127.0.0.1"), 0}) {
    thread_ = std::thread([this] {
      boost::system::error_code failed;
      acceptor_.accept(peer_, failed);
      if (!failed) serve();
    });
  }
  ~HostileWorklist() {
    ending_ = true;
    ::shutdown(acceptor_.native_handle(), SHUT_RDWR);
    ::shutdown(peer_.native_handle(), SHUT_RDWR);
    thread_.join();
  }
  HostileWorklist(const HostileWorklist&) = delete;
  HostileWorklist& operator=(const HostileWorklist&) = delete;
  [[nodiscard]] WorklistOptions options() const {
    WorklistOptions options;
    options.host = "127.0.0.1";
    options.port = acceptor_.local_endpoint().port();
    options.called_ae = "RIS";
    options.timeout = 2s;
    return options;
  }

 private:
  static std::string number(std::uint64_t value, int bytes, bool big) {
    std::string out;
    for (int i = 0; i < bytes; ++i)
      out += static_cast<char>(value >> static_cast<unsigned>(8 * (big ? bytes - 1 - i : i)));
    return out;
  }
  static std::string item(char type, const std::string& body) {
    return std::string{type, 0} + number(body.size(), 2, true) + body;
  }
  static std::string element(unsigned tag, const std::string& value) {
    return number(tag >> 16U, 2, false) + number(tag & 0xFFFFU, 2, false) + number(value.size(), 4, false) +
           value;
  }
  static std::string pdu(char type, const std::string& body) {
    return std::string{type, 0} + number(body.size(), 4, true) + body;
  }
  [[nodiscard]] std::string data(char flags, const std::string& body) const {
    return pdu(4, number(body.size() + 2, 4, true) + context_id_ + flags + body);
  }
  bool send(const std::string& bytes) {
    boost::system::error_code failed;
    boost::asio::write(peer_, boost::asio::buffer(bytes), failed);
    return !failed && !ending_;
  }
  /// Type and body of the next one.
  std::string receive() {
    boost::system::error_code failed;
    std::string head(6, 0);
    boost::asio::read(peer_, boost::asio::buffer(head), failed);
    std::uint32_t size = 0;
    for (int i = 2; i < 6; ++i)
      size = size << 8U | static_cast<unsigned char>(head[static_cast<std::size_t>(i)]);
    std::string body(failed ? 0 : size, 0);
    boost::asio::read(peer_, boost::asio::buffer(body), failed);
    return failed ? "" : head[0] + body;
  }
  /// A C-FIND response: pending, with a dataset behind it, or the last one.
  static std::string command(bool is_pending) {
    const std::string fields = element(0x2, std::string("1.2.840.10008.5.1.4.31") + std::string(2, 0)) +
                               element(0x100, number(0x8020, 2, false)) +
                               element(0x120, number(1, 2, false)) +
                               element(0x800, number(is_pending ? 1 : 0x101, 2, false)) +
                               element(0x900, number(is_pending ? 0xFF00 : 0, 2, false));
    return element(0, number(fields.size(), 4, false)) + fields;
  }
  static std::string dataset(const Step& step) {
    const auto even = [](std::string text) { return text.size() % 2 == 0 ? text : text + " "; };
    std::string item = step.modality.empty() ? "" : element(0x00080060, even(step.modality));
    if (!step.station.empty()) item += element(0x00400001, even(step.station));
    item += element(0x00400002, test::compact_local_time("%Y%m%d")) +
            element(0x00400003, even(test::compact_local_time("%H%M")));
    return element(0x00100010, even(step.patient + "^Given")) + element(0x00100020, even(step.patient)) +
           element(0x00400100, number(0xFFFE, 2, false) + number(0xE000, 2, false) +
                                   number(item.size(), 4, false) + item);
  }
  void serve() {
    const std::string asked = receive();
    constexpr std::size_t kTitles = 5, kItems = 69;
    if (asked.size() < kItems) return;
    std::string answer = number(1, 2, true) + number(0, 2, true) + asked.substr(kTitles, 32) +
                         std::string(32, 0) + item(0x10, "1.2.840.10008.3.1.1.1");
    for (std::size_t at = kItems; at + 4 < asked.size();
         at +=
         4U + static_cast<unsigned char>(asked[at + 2]) * 256U + static_cast<unsigned char>(asked[at + 3])) {
      if (asked[at] != 0x20) continue;
      context_id_ = asked.substr(at + 4, 1);
      answer += item(0x21, context_id_ + std::string(3, 0) + item(0x40, "1.2.840.10008.1.2"));
    }
    answer += item(0x50, item(0x51, number(16'384, 4, true)));
    if (!send(pdu(2, answer))) return;
    for (std::string said = receive();; said = receive()) {
      if (said.size() < 7) return;
      if (said[0] == 4 && said[6] == 2) break;  // the end of the question
    }
    if (answer_ == Answer::kSteps) {
      for (const Step& step : steps_) {
        if (!send(data(3, command(true))) || !send(data(2, dataset(step)))) return;
      }
      send(data(3, command(false)));
      receive();  // the release, and its answer
      send(pdu(6, number(0, 4, true)));
      receive();
      return;
    }
    if (answer_ == Answer::kSilence || !send(data(3, command(true)))) {
      receive();
      return;
    }
    constexpr std::size_t kPiece = 16'000, kDepth = 250'000;
    if (answer_ == Answer::kEndless) {
      std::string begin = element(0x0040A160, "");
      begin.replace(4, 4, number(0x7FFFFFF0, 4, false));
      send(data(0, begin));
      const std::string more = data(0, std::string(kPiece, 'A'));
      while (send(more)) {
      }
    } else {
      const std::string level = number(0x0040, 2, false) + number(0x0100, 2, false) +
                                number(0xFFFFFFFF, 4, false) + number(0xFFFE, 2, false) +
                                number(0xE000, 2, false) + number(0xFFFFFFFF, 4, false);
      std::string piece;
      for (std::size_t i = 0; i < kPiece / level.size(); ++i) piece += level;
      for (std::size_t i = 0; i < kDepth * level.size() / piece.size() && send(data(0, piece)); ++i) {
      }
      receive();
    }
  }

  const Answer answer_;
  const std::vector<Step> steps_;
  boost::asio::io_context context_;
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::ip::tcp::socket peer_{context_};
  std::string context_id_;
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

TEST(WorklistAttack, AnAnswerWithoutBottomEndsNoRecorder) {
  const HostileWorklist worklist(HostileWorklist::Answer::kNested);
  const WorklistAnswer answer = ask_worklist(worklist.options(), utc_now());
  EXPECT_THAT(answer.items, SizeIs(0));
  EXPECT_THAT(answer.problem, HasSubstr("did not answer to the end"));
}

TEST(WorklistAttack, AnAnswerWithoutEndTakesNoMemoryOfTheRecorder) {
  if (!std::string_view(KIROKU_SANITIZERS).empty()) GTEST_SKIP() << "a sanitizer's memory has no limit";
  rusage before{}, after{};
  ::getrusage(RUSAGE_SELF, &before);
  const HostileWorklist worklist(HostileWorklist::Answer::kEndless);
  const WorklistAnswer answer = ask_worklist(worklist.options(), utc_now());
  ::getrusage(RUSAGE_SELF, &after);
  EXPECT_THAT(answer.problem, HasSubstr("did not answer to the end"));
  constexpr long kKilobytes = 200L << 10U;
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, kKilobytes);
}

// Some worklists compare nothing with what they are asked for, and list the whole hospital's day.
TEST(WorklistAttack, AnotherStationsPatientIsNotTaken) {
  using Steps = std::vector<HostileWorklist::Step>;
  const HostileWorklist worklist(
      HostileWorklist::Answer::kSteps,
      Steps{{"OTHER", "CT1", "ES"}, {"OURS", "ENDO1", "ES"}, {"XRAY", "ENDO1", "CR"}, {"NONE", "", ""}});
  WorklistOptions options = worklist.options();
  options.station_ae = "ENDO1";
  options.modality = "ES";
  const WorklistAnswer answer = ask_worklist(options, utc_now());
  ASSERT_THAT(answer.items, SizeIs(1)) << answer.problem;
  EXPECT_EQ(answer.items[0].data.patient_id, "OURS");
  EXPECT_EQ(left_out_of(answer),
            "3 steps of other stations or modalities were listed, too, and cannot be chosen");
}

// A day's steps often have one time.
TEST(WorklistAttack, OfTwoPatientsWhoArePlannedForOneTimeNeitherIsTaken) {
  const HostileWorklist worklist(HostileWorklist::Answer::kSteps,
                                 {{"FIRST", "ENDO1", "ES"}, {"SECOND", "ENDO1", "ES"}});
  const UtcTime now = utc_now();
  const WorklistAnswer answer = ask_worklist(worklist.options(), now);
  ASSERT_THAT(answer.items, SizeIs(2)) << answer.problem;
  EXPECT_EQ(nearest_step(answer, now, now, 12h), std::nullopt);
  EXPECT_EQ(doubt_of(answer, now, 12h), Doubt::kTwoPlanned);
}

TEST(WorklistAttack, OfMoreStepsThanAreReadNoneIsTakenByItself) {
  std::vector<HostileWorklist::Step> steps(kMostWorklistItems + 1, {"FLOOD", "ENDO1", "ES"});
  const HostileWorklist worklist(HostileWorklist::Answer::kSteps, std::move(steps));
  const UtcTime now = utc_now();
  const WorklistAnswer answer = ask_worklist(worklist.options(), now);
  ASSERT_THAT(answer.items, SizeIs(kMostWorklistItems)) << answer.problem;
  EXPECT_EQ(nearest_step(answer, now, now, 12h), std::nullopt);
  EXPECT_THAT(left_out_of(answer), HasSubstr("it lists more than 500 steps"));
}

TEST(WorklistAttack, AWorklistThatSaysNothingKeepsNoRecorderFromEnding) {
  const HostileWorklist worklist(HostileWorklist::Answer::kSilence);
  WorklistOptions options = worklist.options();
  options.timeout = 600s;
  std::atomic<bool> cancelled = false;
  std::future<WorklistAnswer> asked =
      std::async(std::launch::async, [&] { return ask_worklist(options, utc_now(), &cancelled); });
  cancelled = true;
  EXPECT_EQ(asked.wait_for(60s), std::future_status::ready);
  EXPECT_THAT(asked.get().problem, HasSubstr("is not asked any more"));
}

}  // namespace
}  // namespace kiroku::recorder
