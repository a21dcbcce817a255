#include "viewer/report/html_writer.h"

#include <array>
#include <cmath>
#include <cstdio>

namespace kiroku::report {
namespace {

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; --ink: #111; --soft: #5a5a5a; --rule: #c7ccd1; --shade: #f3f5f6; --paper: #fff;
  --good: #125c30; --caution: #7f5200; --bad: #9e1717; }
@media (prefers-color-scheme: dark) { @media screen { :root { --ink: #e8e8e8; --soft: #a9afb5; --rule: #454b52;
  --shade: #1d2227; --paper: #121518; --good: #7fd6a0; --caution: #f0c36d; --bad: #ff9b93; } } }
body { font: 15px/1.5 "DejaVu Sans", "Noto Sans JP", "IPAPGothic", system-ui, sans-serif; color: var(--ink);
  background: var(--paper); max-width: 60rem; margin: 2rem auto; padding: 0 1.25rem; }
h1 { font-size: 1.9rem; margin: 0; } h2 { font-size: 1.25rem; margin: 2.2rem 0 .5rem; } h3 { font-size: 1.02rem; margin: 1.4rem 0 .4rem; }
.subtitle, .small, figcaption, footer { color: var(--soft); } .small, figcaption, footer { font-size: .85rem; }
header { border-bottom: 2px solid var(--ink); padding-bottom: .6rem; margin-bottom: 1.2rem; }
.statement { background: var(--shade); border: 1px solid currentColor; border-left-width: 7px; padding: .8rem 1.1rem; }
.statement > * { color: var(--ink); } .statement .word { font-size: 1.6rem; font-weight: bold; margin: 0; color: inherit; }
.good { color: var(--good); } .caution { color: var(--caution); } .bad { color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-size: .92rem; } th, td { text-align: left; vertical-align: top;
  padding: .3rem .5rem; border-bottom: 1px solid var(--rule); overflow-wrap: anywhere; white-space: pre-line; }
thead th { color: var(--soft); border-bottom: 2px solid var(--rule); } .right { text-align: right; }
code, pre { font-family: "DejaVu Sans Mono", ui-monospace, monospace; font-size: .85em; overflow-wrap: anywhere; }
pre { background: var(--shade); padding: .6rem .8rem; white-space: pre-wrap; margin: .4rem 0 .9rem; }
ol.chain { list-style: none; padding: 0; } ol.chain > li { display: grid; grid-template-columns: 16rem 1fr; gap: 0 1rem; align-items: center; }
.link { background: var(--shade); border: 1px solid var(--rule); border-left: 5px solid currentColor; padding: .45rem .8rem; }
.link b { display: block; color: var(--ink); } .bond { color: var(--soft); font-size: .85rem; padding: .25rem 1rem; }
figure { margin: 1rem 0; } svg { max-width: 100%; height: auto; background: #fff; }
footer { border-top: 1px solid var(--rule); margin-top: 2.5rem; padding-top: .6rem; }
@media print { body { margin: 0; max-width: none; } h2, h3 { break-after: avoid; } tr, .statement, figure, pre { break-inside: avoid; } }
@media (max-width: 40rem) { ol.chain > li { grid-template-columns: 1fr; } }
)css";

std::string escaped(std::string_view text) {
  std::string out;
  for (const char character : text) {
    switch (character) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += character;
    }
  }
  return out;
}

const char* class_of(Tone tone) {
  switch (tone) {
    case Tone::kGood:
      return "good";
    case Tone::kCaution:
      return "caution";
    case Tone::kBad:
      return "bad";
    case Tone::kPlain:
      break;
  }
  return "";
}

std::string marked_up(Tone tone, const std::string& words) {
  const std::string symbol(symbol_of(tone));
  return symbol.empty() ? escaped(words)
                        : "<span aria-hidden=\"true\">" + symbol + "</span> " + escaped(words);
}

std::string element(const std::string& name, const std::string& class_name, const std::string& inside) {
  return "<" + name + (class_name.empty() ? "" : " class=\"" + class_name + "\"") + ">" + inside + "</" +
         name.substr(0, name.find(' ')) + ">";
}

std::string number(double value) {
  std::array<char, 32> text{};
  const int size = std::snprintf(text.data(), text.size(), "%.2f", value);
  return {text.data(), static_cast<std::size_t>(size)};
}

struct Svg {
  std::string operator()(const Area& area) const {
    return "<rect x=\"" + number(area.x) + "\" y=\"" + number(area.y) + "\" width=\"" + number(area.width) +
           "\" height=\"" + number(area.height) + "\" fill=\"" + ink_hex(area.fill) + "\"/>";
  }
  std::string operator()(const Stroke& line) const {
    return "<line x1=\"" + number(line.x0) + "\" y1=\"" + number(line.y0) + "\" x2=\"" + number(line.x1) +
           "\" y2=\"" + number(line.y1) + "\" stroke=\"" + ink_hex(line.ink) + "\" stroke-width=\"" +
           number(line.width) + "\"/>";
  }
  std::string operator()(const Lettering& lettering) const {
    const char* anchor = lettering.anchor == Lettering::Anchor::kStart    ? "start"
                         : lettering.anchor == Lettering::Anchor::kMiddle ? "middle"
                                                                          : "end";
    return "<text x=\"" + number(lettering.x) + "\" y=\"" + number(lettering.baseline) + "\" font-size=\"" +
           number(lettering.size) + "\" text-anchor=\"" + anchor + "\">" + escaped(lettering.text) +
           "</text>";
  }
};

struct Html {
  std::string operator()(const Heading& heading) const {
    return element(heading.level == 1 ? "h2" : "h3", "", escaped(heading.text));
  }
  std::string operator()(const Paragraph& paragraph) const {
    return element("p", paragraph.style == ParagraphStyle::kSmall ? "small" : "", escaped(paragraph.text));
  }
  std::string operator()(const Statement& statement) const {
    std::string inside = element("p", "word", marked_up(statement.tone, statement.word)) +
                         element("p", "", escaped(statement.sentence));
    std::string remarks;
    for (const std::string& remark : statement.remarks) remarks += element("li", "", escaped(remark));
    if (!remarks.empty()) inside += element("ul", "", remarks);
    return element("div", std::string("statement ") + class_of(statement.tone), inside);
  }
  std::string operator()(const Table& table) const {
    std::string head, columns;
    bool has_head = false;
    double shares = 0;
    for (const Column& column : table.columns) shares += column.share;
    for (const Column& column : table.columns) {
      // Else a browser breaks the words of a short answer to make room for a long explanation.
      columns += "<col style=\"width:" + std::to_string(std::lround(100 * column.share / shares)) + "%\">";
      has_head = has_head || !column.title.empty();
      head += element("th scope=\"col\"", right(column), escaped(column.title));
    }
    std::string body;
    for (const auto& cells : table.rows) {
      std::string row;
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const Cell& cell = cells[i];
        std::string inside = marked_up(cell.tone, cell.text);
        if (cell.face == Face::kMono) inside = element("code", "", inside);
        std::string classes = right(table.columns[i]);
        if (cell.tone != Tone::kPlain)
          classes += (classes.empty() ? "" : " ") + std::string(class_of(cell.tone));
        const bool names_row = i == 0 && !has_head;
        if (cell.face == Face::kStrong && !names_row) inside = element("b", "", inside);
        row += element(names_row ? "th scope=\"row\"" : "td", classes, inside);
      }
      body += element("tr", "", row) + "\n";
    }
    return "<table>" + element("colgroup", "", columns) +
           (has_head ? element("thead", "", element("tr", "", head)) : "") + element("tbody", "", body) +
           "</table>";
  }
  std::string operator()(const Chain& chain) const {
    std::string links;
    for (const Chain::Link& link : chain.links) {
      std::string inside =
          element("div", std::string("link ") + class_of(link.title.tone),
                  element("b", "", escaped(link.title.text)) + marked_up(link.title.tone, link.answer)) +
          element("span", "", escaped(link.text));
      if (!link.bond.empty()) inside += element("span", "bond", "↓ " + escaped(link.bond));
      links += element("li", "", inside);
    }
    return element("ol", "chain", links);
  }
  std::string operator()(const Listing& listing) const {
    std::string lines;
    for (const std::string& line : listing.lines) lines += (lines.empty() ? "" : "\n") + escaped(line);
    return element("pre", "", lines);
  }
  std::string operator()(const Picture& picture) const {
    const std::string width = number(picture.figure.width), height = number(picture.figure.height);
    std::string shapes;
    for (const Shape& shape : picture.figure.shapes) shapes += std::visit(Svg{}, shape);
    return element("figure", "",
                   "<svg role=\"img\" aria-label=\"" + escaped(picture.figure.description) +
                       "\" viewBox=\"0 0 " + width + " " + height + "\" width=\"" + width + "pt\" height=\"" +
                       height + "pt\" font-family=\"DejaVu Sans, sans-serif\">" + shapes + "</svg>" +
                       element("figcaption", "", escaped(picture.caption)));
  }
  std::string operator()(const PageBreak& /*page_break*/) const { return ""; }

 private:
  static std::string right(const Column& column) {
    return column.alignment == Alignment::kRight ? "right" : "";
  }
};

}  // namespace

std::string write_html(const Document& document) {
  std::string body = element(
      "header", "",
      element("h1", "", escaped(document.title)) + element("p", "subtitle", escaped(document.subtitle)));
  for (const Block& block : document.blocks) body += std::visit(Html{}, block) + "\n";
  body += element("footer", "", escaped(document.running_foot));
  return "<!DOCTYPE html>\n<html lang=\"" + std::string(language_tag(document.language)) +
         "\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src "
         "'unsafe-inline'\">\n"
         "<meta name=\"generator\" content=\"" +
         escaped(document.program) + "\">\n<meta name=\"author\" content=\"" + escaped(document.author) +
         "\">\n<title>" + escaped(document.title + " · " + document.identifier) + "</title>\n<style>" +
         kStyle + "</style>\n</head>\n<body>\n" + body + "</body>\n</html>\n";
}

}  // namespace kiroku::report
