// Many appliances in one process, which meet one report server. Run by fleet_scale.py.
//   fleet_scale_bench FOLDER URL CONNECTION COUNT AUTHORITY-URL ROOT ROUND-SECONDS WINDOW-SECONDS
//
// Each appliance is what the programs have of one: a recorder's session with a device key of its own, whose
// checkpoints go through its stamper to the aggregator, and a reporter that speaks each five seconds. Each
// has a certificate that the fleet's authority issued, and connections of its own. Sources are the synthetic
// patient alone, and no pictures: what a case weighs is not what is measured. Enrolment goes past the
// address where appliances ask for it, which lets one stranger ask seldom; the rows are those that it makes.
//
// Says "records" once all cases run, "window" and "over" around the time that is measured, then waits for a
// line before it closes the cases, and prints one JSON object. Exit status 2: something failed, and it says
// what.
#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"
#include "crypto/signed_note.h"
#include "fleet/catalogue/fleet_reports.h"
#include "fleet/reports/appliance_report.h"
#include "fleet/reports/fleet_authority.h"
#include "fleet/reports/report_client.h"
#include "fleet/reports/shared_stamp_client.h"
#include "recorder/session.h"
#include "timestamp/client.h"

namespace {

namespace fs = std::filesystem;
using namespace kiroku;
using namespace std::chrono_literals;
using Time = std::chrono::steady_clock;
using nlohmann::ordered_json;

constexpr std::chrono::seconds kReportInterval = 5s;  // as 'kiroku fleet report --follow' has it
constexpr std::chrono::milliseconds kBetweenEnds = 200ms;
constexpr std::size_t kRandomBytes = 16;

double milliseconds(Time::duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::string random_hex() { return crypto::to_hex(crypto::Secret::random(kRandomBytes).bytes()); }

/// What all appliances met in the window. Thread-safe.
class Meetings {
 public:
  void begin() {
    const std::lock_guard guard(mutex_);
    counting_ = true;
  }
  void end() {
    const std::lock_guard guard(mutex_);
    counting_ = false;
  }
  void proof(Time::duration all, Time::duration behind_the_round, std::size_t bytes) {
    const std::lock_guard guard(mutex_);
    if (!counting_) return;
    proofs_.push_back(milliseconds(all));
    behind_.push_back(milliseconds(behind_the_round));
    proof_bytes_ += bytes;
  }
  void submitted(Time::duration took) {
    const std::lock_guard guard(mutex_);
    if (counting_) submissions_.push_back(milliseconds(took));
  }
  void reported(Time::duration took) {
    const std::lock_guard guard(mutex_);
    if (counting_) reports_.push_back(milliseconds(took));
  }
  void failed(const std::string& why) {
    const std::lock_guard guard(mutex_);
    if (!counting_) return;
    ++failures_;
    if (why_.empty()) why_ = why;
  }
  ordered_json told() {
    const std::lock_guard guard(mutex_);
    return {{"proofs", quantiles(proofs_)},
            {"behind_the_round", quantiles(behind_)},
            {"submissions", quantiles(submissions_)},
            {"reports", quantiles(reports_)},
            {"proof_bytes", proof_bytes_},
            {"failures", failures_},
            {"first_failure", why_}};
  }

 private:
  static ordered_json quantiles(std::vector<double>& values) {
    std::ranges::sort(values);
    const auto at = [&](double share) {
      return values.empty()
                 ? 0.0
                 : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
    };
    return {{"count", values.size()}, {"p50_ms", at(0.5)}, {"p95_ms", at(0.95)}, {"most_ms", at(1.0)}};
  }

  std::mutex mutex_;  // of what follows
  bool counting_ = false;
  std::vector<double> proofs_, behind_, submissions_, reports_;
  std::size_t proof_bytes_ = 0, failures_ = 0;
  std::string why_;
};

/// The recorder's way to the aggregator, with a stopwatch.
class TimedStamps final : public evidence::SharedStamps {
  /// What `work` gives, or throws: then it is counted.
  template <typename Work>
  auto told(const Work& work) {
    try {
      return work();
    } catch (const std::exception& error) {
      meetings_.failed(error.what());
      throw;
    }
  }

 public:
  TimedStamps(fs::path identity, Meetings& meetings)
      : client_(std::move(identity), "outside"), meetings_(meetings) {}

  Place enter(ByteView digest, ByteView nonce) override {
    return told([&] {
      submitted_ = Time::now();
      const Place place = client_.enter(digest, nonce);
      meetings_.submitted(Time::now() - submitted_);
      round_ends_ = Time::now() + place.ready_in;
      return place;
    });
  }
  std::optional<Bytes> fetch(const Place& place) override {
    return told([&] {
      std::optional<Bytes> record = client_.fetch(place);
      if (record) meetings_.proof(Time::now() - submitted_, Time::now() - round_ends_, record->size());
      return record;
    });
  }
  [[nodiscard]] std::string path() const override { return client_.path(); }

 private:
  fleet::SharedStampClient client_;
  Meetings& meetings_;
  Time::time_point submitted_, round_ends_;
};

/// Certificates as an administrator gives them.
void enrol(fleet::FleetReports& reports, const fleet::FleetAuthority& authority, const std::string& url,
           const std::string& name, const fs::path& file) {
  fleet::CertificateRequest asked = fleet::make_certificate_request(name);
  fleet::PendingEnrolment request;
  request.id = random_hex();
  request.appliance = name;
  request.request_pem = asked.request_pem;
  request.nonce = random_hex();
  reports.ask(request, "127.0.0.1");
  const std::string certificate = authority.issue(asked.request_pem, utc_now(), std::chrono::hours(24 * 90));
  reports.admit(request, certificate, "fleet_scale_bench");
  fleet::ReportingIdentity{url, name, certificate, authority.certificate_pem(), std::move(asked.key_pem)}
      .write(file);
}

class BenchAppliance {
 public:
  struct Surroundings {
    std::string authority_url;
    const timestamp::TrustStore* trust;
    std::chrono::seconds round;
    Meetings* meetings;
  };
  BenchAppliance(std::string name, fs::path folder, const Surroundings& around)
      : name_(std::move(name)),
        folder_(std::move(folder)),
        key_(crypto::SigningKey::generate()),
        meetings_(*around.meetings),
        began_(Time::now()) {
    std::ofstream(folder_ / "device.pub") << crypto::verifier_key_of(name_, key_).to_string() << "\n";
    recorder::SessionOptions options;
    options.archive = folder_ / "archive";
    fs::create_directories(options.archive);
    options.key = &key_;
    options.device_name = name_;
    options.event_recipients = {crypto::parse_recipient(crypto::generate_age_key().recipient)};
    recorder::StreamRequest vitals;
    vitals.name = vitals.purpose = "vitals";
    vitals.source = "synthetic:patient";
    vitals.recipients = options.event_recipients;
    options.vitals = {vitals};
    recorder::NamedAuthority outside;
    outside.name = "outside";
    timestamp::AuthorityPath directly;
    directly.url = around.authority_url;
    outside.source = timestamp::http_stamp_source(directly);
    outside.shared = std::make_shared<TimedStamps>(identity_file(), meetings_);
    options.authorities = {outside};
    options.trust = around.trust;
    options.stamp_interval = around.round;
    options.segment_duration = 8s;
    session_ = std::make_unique<recorder::Session>(std::move(options));
    recording_ = std::thread([this] {
      try {
        result_ = session_->run();
      } catch (const std::exception& error) {
        problem_ = error.what();
      }
    });
    reporting_ = std::thread([this] { report_for_ever(); });
  }
  ~BenchAppliance() { close(); }
  BenchAppliance(const BenchAppliance&) = delete;
  BenchAppliance& operator=(const BenchAppliance&) = delete;

  void stop() { session_->stop(); }
  void close() {
    stop();
    {
      const std::lock_guard guard(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (recording_.joinable()) recording_.join();
    if (reporting_.joinable()) reporting_.join();
  }
  [[nodiscard]] fs::path identity_file() const { return folder_ / "reporting.json"; }
  /// After close().
  [[nodiscard]] const recorder::SessionResult& result() const {
    if (!problem_.empty()) throw Error(name_ + ": " + problem_);
    return result_;
  }

 private:
  void report_for_ever() {
    std::optional<fleet::ReportClient> client;
    std::unique_lock lock(mutex_);
    for (Time::time_point next = Time::now();; next += kReportInterval) {
      if (changed_.wait_until(lock, next, [this] { return stopping_; })) return;
      lock.unlock();
      const Time::time_point asked = Time::now();
      try {
        if (!client) client.emplace(*fleet::ReportingIdentity::read(identity_file()));
        client->post("/report", fleet::to_json(report()));
        meetings_.reported(Time::now() - asked);
      } catch (const std::exception& error) {
        meetings_.failed(error.what());
      }
      lock.lock();
    }
  }
  fleet::ApplianceReport report() {
    const recorder::SessionStatus status = session_->status();
    fleet::ApplianceReport out;
    out.program = "0.1.0";
    out.run = run_;
    out.number = ++number_;
    out.now = utc_now();
    fleet::RoomReport room;
    room.room = name_;
    room.state = "recording";
    room.case_id = session_->case_id();
    room.recording_s = status.now_ns / 1'000'000'000;
    room.streams = status.streams.size();
    room.missed = status.missed;
    fleet::ApplianceReport::Recorder& recorder = out.recorder.emplace();
    recorder.up_s = std::chrono::duration_cast<std::chrono::seconds>(Time::now() - began_).count();
    recorder.rooms = {room};
    for (const recorder::AuthorityStatus& each : status.authorities)
      recorder.authorities.push_back({each.name, each.failures, {}});
    const fs::space_info disk = fs::space(folder_);
    recorder.disk = {disk.available, disk.capacity, {}};
    recorder.clock = {true, 1'000'000};
    out.has_store = true;
    out.shipping.emplace();
    return out;
  }

  const std::string name_, run_ = random_hex();
  const fs::path folder_;
  const crypto::SigningKey key_;
  Meetings& meetings_;
  const Time::time_point began_;
  std::uint64_t number_ = 0;  // of the reporting thread
  std::unique_ptr<recorder::Session> session_;
  recorder::SessionResult result_;
  std::string problem_;
  std::mutex mutex_;  // of the next
  bool stopping_ = false;
  std::condition_variable changed_;
  std::thread recording_, reporting_;  // last: use the rest
};

struct Wanted {
  fs::path folder;
  std::string url, connection;
  std::size_t count;
  std::string authority_url, root;
  std::chrono::seconds round, window;
};

int measure(const Wanted& wanted) {
  Meetings meetings;
  timestamp::TrustStore trust;
  trust.add_trusted_file(wanted.root);
  const fleet::FleetAuthority authority = fleet::FleetAuthority::open(wanted.folder / "authority");
  fleet::FleetReports reports{fleet::Postgres(wanted.connection)};
  std::vector<std::pair<std::string, fs::path>> places;
  for (std::size_t i = 1; i <= wanted.count; ++i) {
    const std::string name = "or-" + std::to_string(i);
    places.emplace_back(name, wanted.folder / name);
    fs::create_directories(places.back().second);
    enrol(reports, authority, wanted.url, name, places.back().second / "reporting.json");
  }
  // Cases of a hospital do not begin together: these do within one round.
  const Time::duration apart = Time::duration(wanted.round) / wanted.count;
  std::vector<std::unique_ptr<BenchAppliance>> appliances;
  Time::time_point next = Time::now();
  for (const auto& [name, folder] : places) {
    std::this_thread::sleep_until(next += apart);
    appliances.push_back(std::make_unique<BenchAppliance>(
        name, folder, BenchAppliance::Surroundings{wanted.authority_url, &trust, wanted.round, &meetings}));
  }
  std::cout << "records" << std::endl;
  // Until each has been through a whole round.
  std::this_thread::sleep_for(2 * wanted.round);
  meetings.begin();
  std::cout << "window" << std::endl;
  std::this_thread::sleep_for(wanted.window);
  meetings.end();
  std::cout << "over" << std::endl;
  std::string line;
  std::getline(std::cin, line);

  ordered_json cases = ordered_json::array();
  // Nor do they end together; each asks the authority itself for its last time-stamp.
  for (const auto& each : appliances) {
    each->stop();
    std::this_thread::sleep_for(kBetweenEnds);
  }
  for (std::size_t i = 0; i < appliances.size(); ++i) {
    appliances[i]->close();
    const recorder::SessionResult& result = appliances[i]->result();
    cases.push_back({{"device", (places[i].second / "device.pub").string()},
                     {"folder", result.folder.string()},
                     {"duration_ns", result.duration_ns},
                     {"tokens", result.last.tokens},
                     {"missed", result.last.missed}});
  }
  ordered_json told = meetings.told();
  told["cases"] = std::move(cases);
  std::cout << told.dump() << std::endl;
  return 0;
}

}  // namespace

int main(int count, char** words) {
  constexpr int kWords = 9;
  if (count != kWords) {
    std::cerr << "fleet_scale_bench FOLDER URL CONNECTION COUNT AUTHORITY-URL ROOT ROUND-SECONDS "
                 "WINDOW-SECONDS; tests/bench/fleet_scale.py runs it\n";
    return 2;
  }
  try {
    const std::vector<std::string> given(words + 1, words + count);
    return measure({given[0], given[1], given[2], std::stoul(given[3]), given[4], given[5],
                    std::chrono::seconds(std::stoul(given[6])), std::chrono::seconds(std::stoul(given[7]))});
  } catch (const std::exception& error) {
    std::cerr << "fleet_scale_bench: " << error.what() << "\n";
    return 2;
  }
}
