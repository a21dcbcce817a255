// A recorded sample case of which reports, receipts and certificates are made.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "archive/reading/excerpt.h"
#include "base/utc_time.h"
#include "crypto/age_file.h"
#include "crypto/hash.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/process.h"
#include "tests/support/sample_case.h"
#include "tests/unit/viewer/report/document_text.h"
#include "viewer/report/report_document.h"

namespace kiroku::report {

inline bool has_tools() { return std::system("command -v pdftotext pdftoppm zbarimg >/dev/null") == 0; }

inline std::string name_in(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

class ReportDocument : public testing::Test {
 protected:
  [[nodiscard]] ReportInput input(const archive::VerifyOptions& options,
                                  Language language = Language::kEnglish) const {
    ReportInput input;
    input.verification = archive::verify_case(folder_, options);
    input.facts = read_case_facts(folder_, input.verification);
    for (const auto& device : options.devices) input.given.devices.push_back({device.to_string(), {}});
    if (options.trust != nullptr) input.given.roots.push_back({"roots.pem", crypto::sha256({})});
    if (options.log) input.given.log.push_back({"log", {}});
    input.author = "Dr. Sato";
    input.program = "kiroku 0.1.0";
    input.made = *parse_utc("2026-08-06T10:00:00Z");
    input.language = language;
    return input;
  }
  [[nodiscard]] ReportInput input() const { return input(archive_.options()); }
  [[nodiscard]] std::string report(const archive::VerifyOptions& options) const {
    return test::text_of(make_report(input(options)));
  }
  void change_byte(const std::string& file, std::streamoff at) const { test::flip_byte(folder_ / file, at); }
  void write_in_case(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ / file, std::ios::binary | std::ios::trunc) << text;
  }
  std::string tool(const std::vector<std::string>& command) const {
    test::Process::Options run;
    run.command = command;
    run.folder = temporary_.path();
    const test::ProcessResult result = test::run_process(run);
    EXPECT_EQ(result.status, 0) << command[0] << ": " << result.err;
    return result.out;
  }
  std::filesystem::path write(const std::string& name, ByteView bytes) const {
    std::ofstream(temporary_ / name, std::ios::binary) << kiroku::text_of(bytes);
    return temporary_ / name;
  }

  /// The folder becomes an excerpt that was sealed anew for another reader.
  void take_rekeyed_excerpt() {
    const crypto::AgeKeyPair pair = crypto::generate_age_key();
    archive::ExcerptOptions options;
    options.from_ns = 2'000'000'001;
    options.to_ns = 4'000'000'000;
    options.streams = {"endoscope"};
    options.identities = &archive_.identities();
    options.recipients = {crypto::parse_recipient(pair.recipient)};
    archive::make_excerpt(folder_, options, temporary_ / "excerpt");
    folder_ = temporary_ / "excerpt";
    reader_ = {crypto::parse_identity(pair.identity_text.text())};
  }
  /// As its reader verifies it.
  [[nodiscard]] ReportInput input_of_reader(Language language = Language::kEnglish) const {
    archive::VerifyOptions options = archive_.options();
    options.identities = &reader_;
    ReportInput in = input(options, language);
    in.given.identities.push_back({"reader.txt", {}});
    return in;
  }

  test::TemporaryFolder temporary_;
  crypto::AgeIdentities reader_;
  test::SampleArchive archive_;
  std::filesystem::path folder_ = test::SampleCase::write(archive_);
};

inline archive::ExcerptOptions second_segment() {
  archive::ExcerptOptions options;
  options.from_ns = 2'000'000'001;
  options.to_ns = 4'000'000'000;
  options.streams = {"endoscope"};
  options.made_at = parse_utc("2026-08-06T09:00:00Z");
  options.made_by = "Dr. Mori";
  return options;
}

}  // namespace kiroku::report
