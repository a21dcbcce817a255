#include "apps/train/page_sealer.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/train/attempt_numbers.h"
#include "apps/train/attempt_seal.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "viewer/http/disk_room.h"
#include "viewer/http/own_folder.h"
#include "viewer/report/case_facts.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/report_document.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// JPEG pictures one after the other, as libavformat reads them: 25 a second.
constexpr const char* kPictures = "film.mjpeg";
constexpr double kPicturesPerSecond = 25;

class KeptFiles : public viewer::AttemptFiles {
 public:
  explicit KeptFiles(fs::path folder) : folder_(std::move(folder)) {
    fs::create_directory(folder_);
    pictures_.open(folder_ / kPictures, std::ios::binary);
    if (!pictures_) throw Error("no file can be made in " + folder_.string() + ": is the disk full?");
  }
  ~KeptFiles() override {
    std::error_code ignored;  // nobody waits for it; the server's own folder goes anyhow
    fs::remove_all(folder_, ignored);
  }
  KeptFiles(const KeptFiles&) = delete;
  KeptFiles& operator=(const KeptFiles&) = delete;

  void see(const trainer::ExclusionView& view, ByteView jpeg) override {
    vitals_ += vitals_lines(view);
    // A picture stands until the next one came, as on the page.
    const auto due = static_cast<std::uint64_t>(std::floor(view.time_s * kPicturesPerSecond)) + 1;
    for (; written_ + 1 < due && !last_.empty(); ++written_) write(last_);
    last_.assign(jpeg.begin(), jpeg.end());
    if (written_ < due) {
      write(last_);
      ++written_;
    }
  }

  /// All that was seen, on the disk. kiroku::Error where it is not.
  void finish(const trainer::HandMotion& motion) {
    if (finished_) return;  // an earlier try ended later
    // An earlier try may have ended below; closing twice would be an error of the pictures.
    if (pictures_.is_open()) pictures_.close();
    if (!pictures_ || written_ == 0)
      throw Error(
          "not all pictures of the attempt could be kept, so that it cannot be sealed: is the disk full?");
    put(kAttemptVitals, kVitalsHead + vitals_);
    put("hand.txt", trainer::text_of(motion));
    finished_ = true;
  }
  /// Before a case is made of them: since a try that failed before there was one, more may have been said of
  /// the attempt.
  void put_score(const std::string& score) { put("score.json", score); }
  /// They are the case's from now on.
  void move_to(const fs::path& folder) {
    if (moved_) return;  // an earlier try ended later
    std::error_code failed;
    fs::create_directories(folder.parent_path(), failed);
    if (!failed) fs::rename(folder_, folder, failed);
    if (failed) {
      throw Error("the case " + folder.filename().string() +
                  " was made, but the attempt's files cannot be moved to " + folder.string() + ": " +
                  failed.message() + ". Make that possible, then seal the attempt again");
    }
    moved_ = true;
  }
  [[nodiscard]] const fs::path& folder() const { return folder_; }

 private:
  void put(const char* name, const std::string& text) {
    std::ofstream file(folder_ / name, std::ios::binary);
    file << text;
    file.close();
    if (!file) throw Error(std::string(name) + " of the attempt cannot be written: is the disk full?");
  }
  void write(const Bytes& jpeg) {
    pictures_.write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
  }

  fs::path folder_;
  std::ofstream pictures_;
  std::string vitals_;
  Bytes last_;
  std::uint64_t written_ = 0;
  bool finished_ = false, moved_ = false;
};

class PageSealer : public viewer::AttemptSealer {
 public:
  PageSealer(const Home& home, std::uint64_t left)
      : home_(home), own_(home.folder() / "training-files"), left_(left) {}

  void require_room() override {
    viewer::require_disk_room(home_.folder(), 0, "free some, then begin again", left_);
  }

  std::unique_ptr<viewer::AttemptFiles> keep(std::int64_t attempt) override {
    require_room();
    return std::make_unique<KeptFiles>(own_.path() / std::to_string(attempt));
  }

  viewer::SealedAttempt seal(viewer::AttemptFiles& files, const trainer::HandMotion& motion,
                             const nlohmann::ordered_json& facts, const std::string& summary,
                             const std::string& earlier,
                             const std::function<void(const std::string& case_id)>& begun) override {
    const std::unique_lock one(sealing_, std::try_to_lock);
    if (!one) throw Error("another attempt is being sealed: try again in a moment");
    auto& kept = dynamic_cast<KeptFiles&>(files);
    kept.finish(motion);
    std::string case_id = earlier;
    if (earlier.empty() || !holds_whole_attempt(home_.archive() / earlier)) {
      viewer::require_disk_room(home_.archive(), 0, "free some, then seal it again", left_);
      kept.put_score(facts.dump(2) + "\n");
      nlohmann::ordered_json told = facts;
      if (!earlier.empty()) told["instead_of"] = earlier;
      case_id = seal_attempt(home_, kept.folder(), kPictures, told, summary, begun).filename().string();
    }
    kept.move_to(home_.folder() / "training" / case_id);
    return {case_id, std::string(archive::verdict_name(verify(case_id).verdict))};
  }

  Bytes certificate(const std::string& case_id, const std::string& user, report::Language language) override {
    report::ReportInput input;
    input.language = language;
    log_access(home_, home_.archive() / case_id, "made a certificate of training for " + user);
    input.verification = verify(case_id);
    input.facts = report::read_case_facts(home_.archive() / case_id, input.verification);
    input.given.devices = {{home_.device().to_string(), {}}};
    input.given.roots = {{"trust.pem", {}}};
    input.given.own_roots = {{"own-authority.pem", {}}};
    input.given.log = {{home_.log_folder().string(), {}}};
    input.author = user;
    input.program = "kiroku " + std::string(version());
    input.made = utc_now();
    return report::write_pdf(report::make_report(input));
  }

 private:
  [[nodiscard]] archive::VerificationReport verify(const std::string& case_id) const {
    const timestamp::TrustStore trust = home_.trust();
    archive::VerifyOptions options;
    options.devices = {home_.device()};
    options.trust = &trust;
    options.log = home_.log_folder();
    options.threads = std::max(1U, std::thread::hardware_concurrency() / 2);
    return archive::verify_case(home_.archive() / case_id, options);
  }

  const Home& home_;
  viewer::OwnFolder own_;
  const std::uint64_t left_;
  std::mutex sealing_;
};

}  // namespace

std::shared_ptr<viewer::AttemptSealer> make_page_sealer(const Home& home, std::uint64_t left) {
  return std::make_shared<PageSealer>(home, left);
}

}  // namespace kiroku::apps
