#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <span>

#include "archive/reading/case_reader.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "viewer/compare/comparison_document.h"

namespace kiroku::compare {
namespace {

constexpr double kNsPerSecond = 1e9;

std::string escaped(std::string_view text) {
  std::string html;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string number(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string seconds(std::int64_t ns) { return number(double(ns) / kNsPerSecond, 1) + " s"; }

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--ink:#16181c;--faint:#5b6470;--paper:#fff;--line:#d5d9de;--plan:#1f6feb;--real:#b35900}
@media (prefers-color-scheme:dark){:root{--ink:#e8eaed;--faint:#9aa3ad;--paper:#121418;--line:#33383f;--plan:#6ea8fe;--real:#f0a35e}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:62rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.6rem;margin:0 0 .2rem}h2{font-size:1.15rem;margin:2.2rem 0 .6rem}
table{border-collapse:collapse;width:100%;font-size:.92rem}th,td{text-align:left;padding:.3rem .6rem .3rem 0;border-bottom:1px solid var(--line);vertical-align:top}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}.faint{color:var(--faint)}code{font-size:.85em;overflow-wrap:anywhere}
figure{margin:1rem 0}img{max-width:100%;height:auto;border:1px solid var(--line)}figcaption{font-size:.9rem;color:var(--faint)}
svg{width:100%;height:auto}svg text{fill:var(--ink);font-size:12px}svg .faint{fill:var(--faint)}
@media print{body{margin:0;max-width:none}})";

class Page {
 public:
  Page(const Comparison& comparison, const sim::Plan& plan, const Provenance& made)
      : comparison_(comparison), plan_(plan), made_(made), names_(names_of(comparison)) {}

  std::string text(const std::vector<StillPicture>& stills) {
    const std::string title = "Plan and recording: " + escaped(made_.plan.empty() ? "a plan" : made_.plan);
    add("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width,initial-scale=1\">\n<meta http-equiv=\"Content-Security-Policy\" "
        "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n<title>" +
        title + "</title><style>" + kStyle + "</style></head><body>\n<h1>" + title + "</h1>\n");
    summary();
    time_lines();
    steps();
    vitals();
    pressure();
    tools();
    alignment();
    pictures(stills);
    provenance();
    add("</body></html>\n");
    return std::move(html_);
  }

 private:
  void add(const std::string& html) { html_ += html; }
  void head(const std::string& title) { add("<h2>" + title + "</h2>\n"); }
  void row(const std::vector<std::string>& cells, const char* tag = "td", const std::string& numbers = "") {
    add("<tr>");
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool right = i < numbers.size() && numbers[i] == 'r';
      add(std::string("<") + tag + (right ? " class=\"n\">" : ">") + cells[i] + "</" + tag + ">");
    }
    add("</tr>\n");
  }

  static std::vector<std::string> names_of(const Comparison& comparison) {
    std::vector<std::string> names;
    for (const PlannedStep& step : comparison.steps)
      names.push_back(std::to_string(names.size() + 1) + ". " + escaped(step.name));
    return names;
  }

  void summary() {
    const StepMatching& matching = comparison_.matching;
    // First: a page of figures and pictures is believed.
    add("<p><b>The recording was not verified for this comparison.</b> Whether it is whole, and which device "
        "signed it, tells <code>kiroku verify " +
        escaped(made_.case_state.case_id) + "</code>.</p>\n");
    for (const std::string& caution : cautions_of(made_)) add("<p><b>" + escaped(caution) + ".</b></p>\n");
    add("<p>" + std::to_string(matching.matches.size()) + " of " + std::to_string(comparison_.steps.size()) +
        " planned steps were found in the recording, " +
        (matching.in_planned_order() ? "in the planned order" : "<b>in another order than planned</b>") +
        ".");
    if (!matching.missing.empty()) {
      add(" Not found: ");
      for (std::size_t i = 0; i < matching.missing.size(); ++i)
        add((i > 0 ? ", " : "") + names_[matching.missing[i]]);
      add(". A step that was not found may have been done without being marked.");
    }
    add("</p>\n<p class=\"faint\">Times of the recording are those of the case's own clock, from its "
        "beginning. "
        "This page was computed from the sealed case and the plan; it is no part of either.</p>\n");
  }

  /// The plan above, the recording below, what belongs together joined by a band.
  void time_lines() {
    const std::vector<StepMatch>& matches = comparison_.matching.matches;
    if (matches.empty()) return;
    head("Order and time");
    constexpr double kLeft = 70, kWidth = 900, kPlanY = 24, kRealY = 120, kHeight = 22;
    const double plan_s = std::max(1e-3, comparison_.steps.back().end_s());
    const std::int64_t from_ns = matches.front().span.start_ns;
    const double real_s = std::max(1e-3, double(matches.back().span.end_ns - from_ns) / kNsPerSecond);
    const auto plan_x = [&](double at_s) { return kLeft + at_s / plan_s * kWidth; };
    const auto real_x = [&](std::int64_t at_ns) {
      return kLeft + double(at_ns - from_ns) / kNsPerSecond / real_s * kWidth;
    };
    const auto box = [&](double from, double to, double y, const char* colour, const std::string& label) {
      add("<rect x=\"" + number(from, 1) + "\" y=\"" + number(y, 0) + "\" width=\"" +
          number(std::max(1.5, to - from - 1), 1) + "\" height=\"" + number(kHeight, 0) + "\" fill=\"var(--" +
          colour + ")\" fill-opacity=\".75\"><title>" + label + "</title></rect>");
    };
    add("<svg viewBox=\"0 0 980 176\" role=\"img\" aria-label=\"Steps of the plan above, of the recording "
        "below\">\n<text x=\"0\" y=\"40\">plan</text><text x=\"0\" y=\"136\">recording</text>\n");
    for (const StepMatch& match : matches) {
      const PlannedStep& step = comparison_.steps[match.step];
      add("<path d=\"M" + number(plan_x(step.start_s), 1) + " 46L" + number(plan_x(step.end_s()), 1) +
          " 46L" + number(real_x(match.span.end_ns), 1) + " 120L" + number(real_x(match.span.start_ns), 1) +
          " 120Z\" fill=\"var(--faint)\" fill-opacity=\".22\" stroke=\"var(--faint)\" "
          "stroke-opacity=\".5\"/>");
    }
    for (std::size_t i = 0; i < comparison_.steps.size(); ++i) {
      const PlannedStep& step = comparison_.steps[i];
      box(plan_x(step.start_s), plan_x(step.end_s()), kPlanY, "plan", names_[i]);
      add("<text x=\"" + number(plan_x(step.start_s) + 3, 1) + "\" y=\"" + (i % 2 == 0 ? "18" : "40") +
          "\">" + std::to_string(i + 1) + "</text>");
    }
    for (const StepMatch& match : matches) {
      box(real_x(match.span.start_ns), real_x(match.span.end_ns), kRealY, "real", names_[match.step]);
      for (const archive::Span& pause : match.pauses)
        box(real_x(pause.start_ns), real_x(pause.end_ns), kRealY, "paper", "pause");
      add("<text x=\"" + number(real_x(match.span.start_ns) + 3, 1) + "\" y=\"" +
          (match.step % 2 == 0 ? "156" : "136") + "\">" + std::to_string(match.step + 1) + "</text>");
    }
    add("<text class=\"faint\" x=\"" + number(kLeft, 0) + "\" y=\"172\">" + time(from_ns) +
        "</text><text class=\"faint\" x=\"970\" y=\"172\" text-anchor=\"end\">" +
        time(matches.back().span.end_ns) + "</text>\n</svg>\n");
  }

  [[nodiscard]] std::string time(std::int64_t time_ns) const {
    // To the hundredth of a second; what is not known better needs no more.
    constexpr std::int64_t kHundredth = 10'000'000;
    return archive::case_time_text((time_ns + kHundredth / 2) / kHundredth * kHundredth,
                                   comparison_.case_begins_ns);
  }
  static std::string known(KnownFrom from) {
    switch (from) {
      case KnownFrom::kMark:
        return "";
      case KnownFrom::kHand:
        return " <span class=\"faint\">(by hand)</span>";
      case KnownFrom::kNextStep:
        return " <span class=\"faint\">(until the next step)</span>";
      case KnownFrom::kRecordingEnd:
        break;
    }
    return " <span class=\"faint\">(until the recording's end)</span>";
  }

  void steps() {
    head("Steps");
    add("<table>\n");
    constexpr const char* kNumbers = "lrrrrrr";
    row({"step", "done as", "planned for", "lasted", "began at", "pause before", "pauses within"}, "th",
        kNumbers);
    for (const StepFigures& figures : comparison_.figures) {
      const PlannedStep& planned = comparison_.steps[figures.step];
      const StepMatch* const match = comparison_.matching.match_of(figures.step);
      if (match == nullptr) {
        row({names_[figures.step], "not found", number(planned.duration_s, 1) + " s", "", "", "", ""}, "td",
            kNumbers);
        continue;
      }
      row({names_[figures.step], std::to_string(*figures.done_as + 1) + ".",
           number(planned.duration_s, 1) + " s",
           seconds(match->span.end_ns - match->span.start_ns) + known(match->end_from),
           time(match->span.start_ns) + known(match->start_from),
           *figures.done_as == 0     ? "–"
           : figures.pause_before_ns ? seconds(*figures.pause_before_ns)
                                     : "<span class=\"faint\">not known</span>",
           figures.pauses_within_ns > 0 ? seconds(figures.pauses_within_ns) : "–"},
          "td", kNumbers);
    }
    add("</table>\n");
    for (const Mark& mark : comparison_.matching.repeated) {
      add("<p>A step was marked once more at " + time(mark.time_ns) + ": “" + escaped(mark.text) +
          "”.</p>\n");
    }
    for (const Mark& mark : comparison_.matching.ambiguous) {
      add("<p>A mark at " + time(mark.time_ns) +
          " names a step among other words, and was taken for neither its beginning nor its end: “" +
          escaped(mark.text) + "”.</p>\n");
    }
    if (comparison_.record.events_lacking > 0) {
      add("<p>Events to which the ledger commits and whose lines are not there: " +
          std::to_string(comparison_.record.events_lacking) + ". Any of them may have marked a step.</p>\n");
    }
    if (comparison_.map && !comparison_.map->monotone())
      add("<p>As the order differs, each step has a time map of its own.</p>\n");
  }

  void vitals() {
    const bool any = std::ranges::any_of(comparison_.figures,
                                         [](const StepFigures& figures) { return !figures.vitals.empty(); });
    const LeftOut& left_out = comparison_.record.left_out;
    if (!any && !left_out.any()) return;
    head("Vital signs");
    if (left_out.any()) {
      add("<p>Left out here and below: " + std::to_string(left_out.questionable) + " questionable and " +
          std::to_string(left_out.invalid) + " invalid values, and " + std::to_string(left_out.alarms) +
          " alarms that are either. The monitor marks them so, or the recorder, as where they may have been "
          "measured before the case, of an earlier patient.</p>\n");
    }
    if (!any) return;
    add("<p class=\"faint\">Means in the 30 s before each step, while it was done, and in the 30 s "
        "after.</p>\n<table>\n");
    constexpr const char* kNumbers = "llrrr";
    row({"step", "", "before", "during", "after"}, "th", kNumbers);
    const auto value = [](const std::optional<double>& mean) {
      return mean ? number(*mean, std::abs(*mean) < 20 ? 1 : 0) : std::string("–");
    };
    for (const StepFigures& figures : comparison_.figures) {
      bool first = true;
      for (const VitalChange& change : figures.vitals) {
        row({first ? names_[figures.step] : "",
             escaped(change.label + (change.device.empty() ? "" : " (" + change.device + ")") + ", " +
                     change.unit),
             value(change.before), value(change.during), value(change.after)},
            "td", kNumbers);
        first = false;
      }
    }
    add("</table>\n");
  }

  void pressure() {
    head("Blood pressure");
    const PressureLimits& limits = comparison_.limits;
    add("<p class=\"faint\">Alarms of the monitor about an arterial pressure, and pressures beyond a limit: "
        "systolic "
        "below " +
        number(limits.systolic_low, 0) + " or above " + number(limits.systolic_high, 0) +
        " mmHg, mean below " + number(limits.mean_low, 0) + " mmHg.</p>\n");
    std::size_t count = 0;
    for (const StepFigures& figures : comparison_.figures) count += figures.pressure.size();
    not_measured();
    if (count == 0) {
      // Of steps without any measured pressure was said above that nothing is known.
      const bool any = std::ranges::any_of(comparison_.figures, [](const StepFigures& figures) {
        return figures.done_as && figures.measured.judged;
      });
      if (any) add("<p>None while a step was done in which a pressure was measured.</p>\n");
      return;
    }
    add("<table>\n");
    row({"step", "at", "what"}, "th");
    for (const StepFigures& figures : comparison_.figures) {
      for (const PressureEvent& event : figures.pressure)
        row({names_[figures.step], time(event.time_ns),
             (event.is_alarm ? "alarm: " : "") + escaped(event.text)});
    }
    add("</table>\n");
  }

  /// Steps of which no pressure can say anything.
  void not_measured() {
    std::string without, unread;
    std::size_t done = 0, unmeasured = 0;
    for (const StepFigures& figures : comparison_.figures) {
      if (!figures.done_as) continue;
      ++done;
      for (const std::string& unit : figures.measured.unread_units)
        unread += (unread.empty() ? "" : ", ") + names_[figures.step] + " (" +
                  (unit.empty() ? "no unit stated" : escaped(unit)) + ")";
      if (figures.measured.judged || !figures.measured.unread_units.empty()) continue;
      ++unmeasured;
      without += (without.empty() ? "" : ", ") + names_[figures.step];
    }
    if (unmeasured > 0)
      add("<p><b>Not measured:</b> no systolic or mean arterial pressure was recorded " +
          (unmeasured == done ? std::string("while any step was done") : "during " + without) + ".</p>\n");
    if (!unread.empty())
      add("<p><b>Not judged:</b> recorded in a unit that is none of a pressure: " + unread + ".</p>\n");
  }

  void tools() {
    if (!comparison_.camera) return;
    head("Camera and tools");
    const CameraTrack& camera = *comparison_.camera;
    add("<p>The camera was found from " + std::to_string(camera.registration().error_px.size()) +
        " points that were picked on the organ and in the picture; it sees them " +
        number(camera.registration().rms_px, 1) + " pixels (root mean square) from where they were picked" +
        (camera.registration().field_estimated ? ", with a field of view that was estimated" : "") + ". ");
    add(camera.lost_ns() ? "It was followed until " + time(*camera.lost_ns()) +
                               " and lost then: later pictures are seen by the last camera."
                         : std::string("It was followed to the end."));
    add("</p>\n");
    if (comparison_.tools.empty()) return;
    add("<table>\n");
    constexpr const char* kNumbers = "llrrr";
    row({"tool", "step", "pictures", "mean distance", "largest"}, "th", kNumbers);
    const auto line = [&](const std::string& tool, const std::string& step, const Distance& distance) {
      row({tool, step, std::to_string(distance.pictures), number(distance.mean_px, 1) + " px",
           number(distance.largest_px, 1) + " px"},
          "td", kNumbers);
    };
    for (const ToolDistance& tool : comparison_.tools) {
      line(escaped(plan_.tools[tool.tool].tool.name), "all", tool.all);
      for (std::size_t step = 0; step < tool.of_steps.size(); ++step) {
        if (tool.of_steps[step].pictures > 0) line("", names_[step], tool.of_steps[step]);
      }
    }
    add("</table>\n");
    for (const ToolDistance& tool : comparison_.tools) {
      for (const archive::Span& lost : tool.lost)
        add("<p>" + escaped(plan_.tools[tool.tool].tool.name) + " was lost from " + time(lost.start_ns) +
            " to " + time(lost.end_ns) + ".</p>\n");
    }
  }

  void alignment() {
    if (!comparison_.alignment) return;
    const Alignment& found = *comparison_.alignment;
    head("The plan on the recording");
    add("<p>Its organ was looked for in " + std::to_string(found.moments.size()) +
        " pictures without a click, as a rigid body, and placed in " + std::to_string(found.held()) +
        " of them.</p>\n");
    if (found.deformed) {
      constexpr double kMmPerM = 1000;
      add("<p>It was deformed to fit in " + std::to_string(found.deformed->deformed()) +
          " pictures, and displaced by up to " + number(kMmPerM * found.deformed->largest_m(), 1) +
          " mm there. Where the endoscope moves, or a deformation explains a picture no better, it stays "
          "rigid:</p>\n<table>\n");
      row({"pictures", "because"}, "th", "r");
      for (const auto& [why, pictures] : found.deformed->rigid())
        row({std::to_string(pictures), sentence_of(why)}, "td", "r");
      add("</table>\n");
    }
    departures(found);
    if (found.lost().empty()) return;
    add("<table>\n");
    row({"not placed from", "to", "because"}, "th");
    for (const Alignment::Lost& lost : found.lost())
      row({time(lost.span.start_ns), time(lost.span.end_ns), sentence_of(lost.why)});
    add("</table>\n");
  }

  void departures(const Alignment& found) {
    if (!found.deformed || found.deformed->departures.empty()) return;
    constexpr double kMmPerM = 1000;
    add("<p>Where the recording shows the organ's surface, against where the plan has it at that moment. "
        "Told is "
        "what exceeds two standard errors, in a twentieth of the surface at least. Another pace than the "
        "plan's is "
        "a departure, too.</p>\n<table>\n");
    constexpr const char* kNumbers = "lrrl";
    row({"step", "pictures compared", "departing", "by up to"}, "th", kNumbers);
    const std::vector<StepDeparture> steps = found.step_departures();
    for (std::size_t at = 0; at < comparison_.steps.size(); ++at) {
      const auto step = std::ranges::find(steps, at, &StepDeparture::step);
      if (step == steps.end() || step->compared == 0) {
        row({names_[at], "0", "",
             step == steps.end() ? "nothing can be said: not looked at"
                                 : "nothing can be said: no picture could be compared with the plan"},
            "td", kNumbers);
        continue;
      }
      row({names_[at], std::to_string(step->compared) + " of " + std::to_string(step->pictures),
           std::to_string(step->departed),
           step->departed == 0
               ? "within two standard errors"
               : number(kMmPerM * step->largest_m, 1) + " mm, standard error " +
                     number(kMmPerM * step->largest_error_m, 1) + " mm, at " + time(step->at_ns)},
          "td", kNumbers);
    }
    add("</table>\n");
  }

  void pictures(const std::vector<StillPicture>& stills) {
    if (stills.empty()) return;
    head("Pictures");
    for (const StillPicture& still : stills) {
      add("<figure><img alt=\"" + escaped(still.caption) + "\" src=\"data:image/png;base64," +
          crypto::to_base64(still.png, crypto::Base64Padding::kPadded) + "\"><figcaption>" +
          escaped(still.caption) + "</figcaption></figure>\n");
    }
  }

  void provenance() {
    head("What this stands on");
    const auto hash = [](const crypto::Sha256Digest& digest) {
      return "<code>" + crypto::to_hex(digest) + "</code>";
    };
    add("<table>\n");
    row({"made by",
         escaped(made_.made_by) + ", " + format_utc(made_.made_at) + ", with " + escaped(made_.program)});
    row({"case", escaped(made_.case_state.case_id) + ", pictures of “" + escaped(comparison_.stream) +
                     "”; its first " + std::to_string(made_.case_state.ledger_size) +
                     " ledger entries have the root " + hash(made_.case_state.ledger_root)});
    row({"plan", escaped(made_.plan) +
                     (made_.plan_sealed ? ", sealed: " : ", <b>not sealed</b>; its seal would be ") +
                     hash(made_.plan_seal)});
    row({"the case", !made_.case_names_plan   ? "names no plan"
                     : *made_.case_names_plan ? "was recorded by this plan"
                                              : "<b>was recorded by another plan</b>"});
    for (const NamedFile& file : made_.plan_files)
      row({escaped(file.role), escaped(file.name) + " " + hash(file.sha256)});
    if (made_.ct) {
      for (const NamedFile& file : made_.ct->files)
        row({"CT, <b>not the plan's</b>", escaped(file.name) + " " + hash(file.sha256)});
      if (!made_.ct->series.empty()) row({"series of the CT", "…" + escaped(made_.ct->series)});
    }
    if (made_.of_one_patient)
      row({"patient", *made_.of_one_patient ? "CT and case state the same number"
                                            : "<b>CT and case state different numbers</b>"});
    add("</table>\n<p class=\"faint\">Whether this comparison still fits case and plan tells <code>kiroku "
        "compare --verify</code> of the document beside this page.</p>\n");
  }

  const Comparison& comparison_;
  const sim::Plan& plan_;
  const Provenance& made_;
  std::vector<std::string> names_;
  std::string html_;
};

}  // namespace

std::string comparison_html(const Comparison& comparison, const sim::Plan& plan, const Provenance& made,
                            const std::vector<StillPicture>& stills) {
  return Page(comparison, plan, made).text(stills);
}

}  // namespace kiroku::compare
