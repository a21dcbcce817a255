#include "apps/quality/study_results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "base/csv_field.h"
#include "crypto/encoding.h"
#include "trainer/report/plot.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
using Rows = std::vector<std::vector<std::string>>;

std::string fixed(double value, int digits) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  return text.data();
}
std::string signed_fixed(double value, int digits) { return (value > 0 ? "+" : "") + fixed(value, digits); }
std::string percent(double share) { return fixed(100 * share, 0) + " %"; }
std::string p_text(double p) {
  constexpr double kSmallest = 0.0001;
  return p < kSmallest ? "< 0.0001" : fixed(p, 4);
}

std::string kappa_text(const std::optional<trainer::Agreement>& agreement) {
  if (!agreement || !agreement->kappa) return "-";
  const trainer::Kappa& kappa = *agreement->kappa;
  if (!kappa.interval) return fixed(kappa.value, 2) + " (none)";
  return fixed(kappa.value, 2) + " (" + fixed(kappa.interval->low, 2) + " to " +
         fixed(kappa.interval->high, 2) + ")";
}

std::vector<std::string> points_row(const std::string& name, const study::Points& points) {
  std::vector<std::string> row{name};
  for (const std::size_t given : points.given) row.push_back(std::to_string(given));
  row.push_back(points.median ? fixed(*points.median, 1) : "-");
  row.push_back(points.share_judged ? percent(*points.share_judged) : "-");
  row.push_back(kappa_text(points.agreement));
  row.push_back(kappa_text(points.agreement_quadratic));
  return row;
}

/// Of one question; the first row is the head.
Rows points_rows(const StudyResult& result, std::size_t question) {
  Rows rows{{"coding", "1", "2", "3", "4", "5", "median", "4 or 5", "kappa (95 %)", "weighted (95 %)"}};
  for (std::size_t coding = 0; coding < result.key.codings.size(); ++coding)
    rows.push_back(points_row(result.key.codings[coding].name, result.findings.by_coding[coding][question]));
  rows.push_back(points_row("all together", result.findings.together[question]));
  return rows;
}

Rows difference_rows(const StudyResult& result, std::size_t question) {
  Rows rows{{"first", "second", "clips: higher", "equal", "lower", "mean", "p", "p, all asked"}};
  for (const study::CodingDifference& one : result.findings.differences) {
    if (one.question != question) continue;
    rows.push_back({result.key.codings[one.first].name, result.key.codings[one.second].name,
                    std::to_string(one.higher), std::to_string(one.equal), std::to_string(one.lower),
                    one.mean ? signed_fixed(*one.mean, 2) : "-", one.test.p ? p_text(*one.test.p) : "-",
                    one.p_adjusted ? p_text(*one.p_adjusted) : "-"});
  }
  return rows;
}

Rows own_rows(const StudyResult& result) {
  Rows rows{{"reader", "question", "seen again", "same", "within 1", "kappa (95 %)", "weighted (95 %)"}};
  for (const study::OwnAgreement& one : result.findings.own) {
    rows.push_back({std::to_string(one.reader + 1), std::to_string(one.question + 1),
                    std::to_string(one.count), std::to_string(one.same), std::to_string(one.within_one),
                    kappa_text(one.agreement), kappa_text(one.agreement_quadratic)});
  }
  return rows;
}

/// Each film with what each reader gave it at first.
Rows film_rows(const StudyResult& result) {
  Rows rows{{"clip", "coding"}};
  for (std::size_t question = 0; question < result.study.questions.size(); ++question)
    rows[0].push_back("question " + std::to_string(question + 1));
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const study::Rating*>> films;
  for (const study::Rating& one : result.ratings) {
    if (!one.again) films[{one.clip, one.coding}].push_back(&one);
  }
  for (const auto& [film, ratings] : films) {
    std::vector<std::string> row{result.key.clips[film.first].name, result.key.codings[film.second].name};
    for (std::size_t question = 0; question < result.study.questions.size(); ++question) {
      std::string given;
      for (std::size_t reader = 0; reader < result.study.readers.size(); ++reader) {
        const auto found = std::ranges::find(ratings, reader, [](const auto* one) { return one->reader; });
        const int points = found == ratings.end() ? 0 : (*found)->points[question];
        given += (reader == 0 ? "" : " ") + (points == 0 ? std::string("-") : std::to_string(points));
      }
      row.push_back(given);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string question_heading(const StudyResult& result, std::size_t question) {
  return "Question " + std::to_string(question + 1) + ": " + result.study.questions[question];
}

std::string heading(const StudyResult& result) {
  return result.study.title.empty() ? "What readers judged of codings" : result.study.title;
}

std::string facts(const StudyResult& result) {
  std::size_t answered = 0, showings = 0;
  for (const study::Progress& one : result.closing.progress) {
    answered += one.answered;
    showings += one.showings;
  }
  std::string text =
      "Study " + result.study.id + ": " + std::to_string(result.key.clips.size()) + " clips in " +
      std::to_string(result.key.codings.size()) + " codings, " + std::to_string(result.study.readers.size()) +
      " readers, " + std::to_string(answered) + " of " + std::to_string(showings) + " films judged. Made " +
      format_utc_for_people(result.study.made) + ", closed " + format_utc_for_people(result.closing.utc) +
      "; SHA-256 of sealed.json " + crypto::to_hex(result.closing.sha256) + ".";
  if (answered < showings) text += " It was closed before all was judged.";
  if (result.findings.dropped > 0) {
    text += " Of " + std::to_string(result.findings.pictures) +
            " pictures the readers' computer did not show " + std::to_string(result.findings.dropped) +
            ", so that films did not run as they are.";
  }
  if (result.findings.never_to_the_end > 0)
    text += " " + std::to_string(result.findings.never_to_the_end) +
            " answers are of films that were not played to their end.";
  for (const study::StudyKey::Clip& clip : result.key.clips) {
    if (!clip.remark.empty()) text += " " + clip.name + ": " + clip.remark + ".";
  }
  return text;
}

std::string points_meaning(const StudyResult& result) {
  std::string text = "Points:";
  for (std::size_t i = 0; i < result.study.points.size(); ++i)
    text += (i == 0 ? " " : ", ") + std::to_string(i + 1) + " " + result.study.points[i];
  return text + ".";
}

std::string how(const StudyResult& result) {
  std::string text =
      "Points are of each film the first time a reader saw it. The median is of all of them, '4 or 5' their "
      "share. ";
  if (result.study.readers.size() == 2) {
    text +=
        "Kappa is Cohen's, of both readers, film by film; its interval stands on the standard error of "
        "Fleiss, Cohen and Everitt (1969). Weighted: by the square of the difference (Fleiss and Cohen, "
        "1973). ";
  } else if (result.study.readers.size() > 2) {
    text +=
        "Kappa is Fleiss' (1971), of all readers, film by film; its interval stands on Gwet's standard error "
        "(2014). Weighted: by the square of the difference. ";
  }
  text +=
      "'All together' takes the films of all codings for independent, which those of one clip are not quite. "
      "Intervals of few films are rough, as the formulas are those of many; there is none where all agree or "
      "none do.";
  return text;
}

constexpr const char* kHowDifferences =
    "Each clip is one pair: the readers' mean points in the first coding less those in the second. "
    "Wilcoxon's "
    "signed-rank test over clips, two-sided and exact, also where points are alike: points are ordered and "
    "few, and answers to one clip hang together, so that clips are counted and not answers. Fewer than six "
    "clips that differ can never reach p < 0.05. The last column holds for all differences together (Holm, "
    "1979).";
constexpr const char* kHowOwn =
    "Films that a reader saw twice: how often the points were the same, or one apart, and Cohen's kappa of "
    "first and second time.";

ordered_json agreement_json(const std::optional<trainer::Agreement>& agreement) {
  if (!agreement) return nullptr;
  ordered_json json{
      {"films", agreement->count}, {"observed", agreement->observed}, {"by_chance", agreement->by_chance}};
  if (agreement->kappa) {
    json["kappa"] = agreement->kappa->value;
    json["standard_error"] = agreement->kappa->standard_error;
    json["interval"] = nullptr;
    if (const auto& interval = agreement->kappa->interval) json["interval"] = {interval->low, interval->high};
  } else {
    json["kappa"] = nullptr;
    json["why_no_kappa"] = agreement->why_no_kappa;
  }
  return json;
}

template <typename Number>
ordered_json or_null(const std::optional<Number>& number) {
  return number ? ordered_json(*number) : ordered_json(nullptr);
}

ordered_json points_json(const study::Points& points) {
  return {{"answers", points.count},
          {"given", points.given},
          {"median", or_null(points.median)},
          {"mean", or_null(points.mean)},
          {"share_4_or_5", or_null(points.share_judged)},
          {"agreement", agreement_json(points.agreement)},
          {"agreement_quadratic", agreement_json(points.agreement_quadratic)}};
}

std::string why_no_kappa(const StudyResult& result, std::size_t question) {
  std::string text;
  for (std::size_t coding = 0; coding < result.key.codings.size(); ++coding) {
    const auto& agreement = result.findings.by_coding[coding][question].agreement;
    if (agreement && !agreement->kappa)
      text += "No kappa of " + result.key.codings[coding].name + ": " + agreement->why_no_kappa + ". ";
  }
  return text;
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else if (c == '&') {
      safe += "&amp;";
    } else if (c == '"') {
      safe += "&quot;";
    } else {
      safe += c;
    }
  }
  return safe;
}

/// The first `words` columns are words, the others figures.
std::string html_table(const Rows& rows, int words) {
  std::string out = "<div class=\"table\"><table class=\"words" + std::to_string(words) + "\">\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string cell = i == 0 ? "th" : "td";
    out += "<tr>";
    for (const std::string& text : rows[i])
      out.append("<").append(cell).append(">").append(escaped(text)).append("</").append(cell).append(">");
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

/// Shares of points in each coding, side by side, from 1 to 5.
std::string html_bars(const StudyResult& result, std::size_t question) {
  std::string out = "<div class=\"bars\" role=\"img\" aria-label=\"shares of points, as in the table\">\n";
  for (std::size_t coding = 0; coding < result.key.codings.size(); ++coding) {
    const study::Points& points = result.findings.by_coding[coding][question];
    out += "<span>" + escaped(result.key.codings[coding].name) + "</span><svg viewBox=\"0 0 1000 40\" " +
           "preserveAspectRatio=\"none\">";
    double x = 0;
    for (std::size_t i = 0; i < points.given.size(); ++i) {
      if (points.given[i] == 0) continue;
      const double width = 1000 * static_cast<double>(points.given[i]) / static_cast<double>(points.count);
      out += "<rect class=\"p" + std::to_string(i + 1) + "\" x=\"" + fixed(x, 1) + "\" width=\"" +
             fixed(width, 1) + "\" height=\"40\"><title>" + std::to_string(i + 1) + ": " +
             std::to_string(points.given[i]) + "</title></rect>";
      x += width;
    }
    out += "</svg>\n";
  }
  out += "<span></span><p>";
  for (std::size_t i = 0; i < result.study.points.size(); ++i)
    out += "<i class=\"p" + std::to_string(i + 1) + "\"></i>" + std::to_string(i + 1) + " " +
           escaped(result.study.points[i]) + " ";
  return out + "</p></div>\n";
}

constexpr const char* kHtmlBegin = R"page(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<style>
body { margin: 0; font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; }
main { max-width: 75rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.4rem; }
h2 { font-size: 1.1rem; margin: 1.75rem 0 .5rem; }
h3 { font-size: 1rem; margin: 1rem 0 .25rem; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
th:first-child, td:first-child, .words2 :nth-child(2) { text-align: left; }
.small { color: #555; font-size: .9rem; max-width: 60rem; }
.facts { max-width: 60rem; overflow-wrap: anywhere; }
.bars { display: grid; grid-template-columns: max-content 1fr; gap: .35rem .75rem; align-items: center; max-width: 60rem; margin: .5rem 0; }
.bars svg { width: 100%; height: 1.5rem; }
.bars p { margin: 0; font-size: .9rem; }
.bars i { display: inline-block; width: .9em; height: .9em; margin: 0 .3em 0 .6em; vertical-align: -.1em; }
.p1 { fill: #b35806; background: #b35806; } .p2 { fill: #f1a340; background: #f1a340; } .p3 { fill: #d8d8d8; background: #d8d8d8; }
.p4 { fill: #998ec3; background: #998ec3; } .p5 { fill: #542788; background: #542788; }
.differs { color: #a00; }
</style>
)page";

}  // namespace

std::string study_text(const StudyResult& result) {
  std::string text = printable(facts(result)) + "\n" + printable(points_meaning(result)) + "\n";
  for (std::size_t question = 0; question < result.study.questions.size(); ++question) {
    text += "\n" + printable(question_heading(result, question)) + "\n\n" +
            format_table(points_rows(result, question), "lrrrrrrrrr", 0);
    const std::string why = why_no_kappa(result, question);
    if (!why.empty()) text += printable(why) + "\n";
    text += "\n" + format_table(difference_rows(result, question), "llrrrrrr", 0);
  }
  if (!result.findings.own.empty())
    text += "\nReaders beside themselves\n\n" + format_table(own_rows(result), "rrrrrrr", 0);
  return text;
}

ordered_json study_json(const StudyResult& result) {
  ordered_json json{{"study", result.study.id},
                    {"title", result.study.title},
                    {"made_utc", format_utc(result.study.made)},
                    {"closed_utc", format_utc(result.closing.utc)},
                    {"sealed_sha256", crypto::to_hex(result.closing.sha256)},
                    {"questions", result.study.questions},
                    {"points", result.study.points},
                    {"readers", ordered_json::array()},
                    {"clips", ordered_json::array()},
                    {"checks", ordered_json::array()},
                    {"methods", {how(result), kHowDifferences, kHowOwn}},
                    {"codings", ordered_json::array()},
                    {"together", ordered_json::array()},
                    {"differences", ordered_json::array()},
                    {"own_agreement", ordered_json::array()},
                    {"pictures", result.findings.pictures},
                    {"pictures_dropped", result.findings.dropped},
                    {"not_played_to_the_end", result.findings.never_to_the_end}};
  for (const study::Progress& one : result.closing.progress)
    json["readers"].push_back({{"answered", one.answered}, {"showings", one.showings}});
  for (const study::StudyKey::Clip& clip : result.key.clips)
    json["clips"].push_back({{"clip", clip.name}, {"pictures_are", clip.pictures_are}});
  for (const Check& check : result.checks) {
    json["checks"].push_back(
        {{"about", check.what}, {"answer", answer_name(check.answer)}, {"text", check.text}});
  }
  for (std::size_t coding = 0; coding < result.key.codings.size(); ++coding) {
    ordered_json one{{"coding", result.key.codings[coding].word}, {"name", result.key.codings[coding].name}};
    if (result.key.codings[coding].bit_rate > 0) one["bit_rate"] = result.key.codings[coding].bit_rate;
    one["questions"] = ordered_json::array();
    for (const study::Points& points : result.findings.by_coding[coding])
      one["questions"].push_back(points_json(points));
    json["codings"].push_back(std::move(one));
  }
  for (const study::Points& points : result.findings.together)
    json["together"].push_back(points_json(points));
  for (const study::CodingDifference& one : result.findings.differences) {
    ordered_json difference{{"question", one.question + 1},
                            {"first", result.key.codings[one.first].name},
                            {"second", result.key.codings[one.second].name},
                            {"clips_higher", one.higher},
                            {"clips_equal", one.equal},
                            {"clips_lower", one.lower},
                            {"mean", or_null(one.mean)},
                            {"p", or_null(one.test.p)},
                            {"p_adjusted", or_null(one.p_adjusted)}};
    if (!one.test.p) difference["why_no_test"] = one.test.why_no_test;
    json["differences"].push_back(std::move(difference));
  }
  for (const study::OwnAgreement& one : result.findings.own) {
    json["own_agreement"].push_back({{"reader", one.reader + 1},
                                     {"question", one.question + 1},
                                     {"films", one.count},
                                     {"same", one.same},
                                     {"within_one", one.within_one},
                                     {"agreement", agreement_json(one.agreement)},
                                     {"agreement_quadratic", agreement_json(one.agreement_quadratic)}});
  }
  return json;
}

std::string study_csv(const StudyResult& result) {
  std::string text = "reader,place,clip,coding,again";
  for (std::size_t i = 1; i <= result.study.questions.size(); ++i) text += ",question_" + std::to_string(i);
  text += ",plays,pictures,dropped,utc\r\n";
  for (const study::Rating& one : result.ratings) {
    text += std::to_string(one.reader + 1) + "," + std::to_string(one.place + 1) + "," +
            csv_field(result.key.clips[one.clip].name) + "," +
            csv_field(result.key.codings[one.coding].name) + "," + (one.again ? "1" : "0");
    for (const int points : one.points) text += points == 0 ? "," : "," + std::to_string(points);
    text += "," + std::to_string(one.seen.plays) + "," + std::to_string(one.seen.pictures) + "," +
            std::to_string(one.seen.dropped) + "," + format_utc(one.utc) + "\r\n";
  }
  return text;
}

Bytes study_pdf(const StudyResult& result) {
  std::vector<trainer::ReportBlock> blocks;
  blocks.push_back({"", facts(result) + " " + points_meaning(result), {}, {}});
  for (std::size_t question = 0; question < result.study.questions.size(); ++question) {
    blocks.push_back({question_heading(result, question),
                      why_no_kappa(result, question),
                      points_rows(result, question),
                      {}});
    blocks.push_back({"", "", difference_rows(result, question), {}});
  }
  if (!result.findings.own.empty())
    blocks.push_back({"Readers beside themselves", kHowOwn, own_rows(result), {}});
  blocks.push_back({"Each film, as each reader judged it at first", "", film_rows(result), {}});
  blocks.push_back({"How this was counted", how(result) + " " + kHowDifferences, {}, {}});
  // As paragraphs: a table's cells are not wrapped.
  for (std::size_t i = 0; i < result.checks.size(); ++i) {
    const Check& check = result.checks[i];
    blocks.push_back({i == 0 ? "Whether the answers are as they were" : "",
                      check.what + ", " + answer_name(check.answer) + ": " + check.text,
                      {},
                      {}});
  }
  return trainer::report_pdf(heading(result), blocks);
}

std::string study_html(const StudyResult& result) {
  std::string out = kHtmlBegin;
  out += "<title>" + escaped(heading(result)) + "</title>\n</head>\n<body>\n<main>\n<h1>" +
         escaped(heading(result)) + "</h1>\n<p class=\"facts\">" + escaped(facts(result)) + "</p>\n";
  for (std::size_t question = 0; question < result.study.questions.size(); ++question) {
    out += "<h2>" + escaped(question_heading(result, question)) + "</h2>\n" + html_bars(result, question) +
           html_table(points_rows(result, question), 1);
    const std::string why = why_no_kappa(result, question);
    if (!why.empty()) out += "<p class=\"small\">" + escaped(why) + "</p>\n";
    out += "<h3>Codings beside each other</h3>\n" + html_table(difference_rows(result, question), 2);
  }
  if (!result.findings.own.empty()) {
    out += "<h2>Readers beside themselves</h2>\n" + html_table(own_rows(result), 1) + "<p class=\"small\">" +
           escaped(kHowOwn) + "</p>\n";
  }
  out += "<h2>Each film, as each reader judged it at first</h2>\n" + html_table(film_rows(result), 2) +
         "<h2>How this was counted</h2>\n<p class=\"small\">" + escaped(how(result)) +
         "</p>\n<p class=\"small\">" + escaped(kHowDifferences) +
         "</p>\n<h2>Whether the answers are as they were</h2>\n<ul>\n";
  for (const Check& check : result.checks) {
    out += std::string("<li") + (check.answer == Check::Answer::kDiffers ? " class=\"differs\"" : "") + ">" +
           escaped(check.what + ": " + check.text) + "</li>\n";
  }
  return out + "</ul>\n</main>\n</body>\n</html>\n";
}

}  // namespace kiroku::apps
