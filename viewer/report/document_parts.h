// Parts that several documents have. Pure functions, thread-safe.
#pragma once

#include <string>

#include "viewer/report/document.h"
#include "viewer/report/report_document.h"

namespace kiroku::report {

/// Points between the margins of a page.
inline constexpr double kTextWidth = 487;

std::string verdict_words(Language language, archive::Verdict verdict);
Tone tone_of(archive::Verdict verdict);
/// Where a document has the brackets of time, of which a sentence on the time speaks.
enum class Brackets { kBelow, kInTheReport, kUnsaid };
/// Whose clock says when it was, and what limits the worth of that.
std::string time_sentence(const ReportInput& input, Brackets brackets = Brackets::kBelow);
/// What the case's evidence record proves, or why nothing; "" where there is none.
std::string evidence_sentence(const ReportInput& input);
/// Whether what the log says of the case's end is witnessed; "" where no policy of witnesses was given.
std::string witness_sentence(const ReportInput& input);
/// What was signed only when recording was found cut off, and segments that were found then; "" where there
/// is neither.
std::string signed_late_sentence(const ReportInput& input);
/// Names of the streams of pictures of which none was opened, though others were; "" where there is none.
std::string unopened_pictures(const archive::VerificationReport& verification);
/// Whether the record is of a later version of the format: nothing is known of what its entries say.
bool is_of_later_version(const archive::VerificationReport& verification);
/// Verdict, what it means, and what is to be known with it.
Statement verdict_statement(const ReportInput& input, Brackets brackets = Brackets::kBelow);
/// The document's frame: languages, titles, metadata, no blocks.
Document empty_document(const ReportInput& input, std::string title);
/// A table without head: what a thing is called, and what it is.
Table facts_table();
void add_fact(Table& table, std::string name, std::string value, Face face = Face::kText);
/// Whether the device's key is among the given ones, in words.
std::string device_trust_words(const ReportInput& input);
/// When the case was closed, by the device's clock, and by how much that was set in between. There must be an
/// end.
std::string closed_words(const ReportInput& input);
/// Whether its evidence record proves since when it existed, by clocks outside.
bool is_proved_by_record(const archive::VerificationReport& verification);
/// By which keys of the device its checkpoints were checked.
std::string signature_words(const ReportInput& input);
/// A case's identifier begins with a time, which whoever made the case chose: says so where it is more than
/// ten minutes from the opening's.
std::string identifier_words(const ReportInput& input, const std::string& identifier);

}  // namespace kiroku::report
