// A document as plain lines, for expectations. Functions; thread-safe.
#pragma once

#include <string>

#include "viewer/report/document.h"

namespace kiroku::test {

struct DocumentText {
  std::string operator()(const report::Heading& heading) const { return "# " + heading.text + "\n"; }
  std::string operator()(const report::Paragraph& paragraph) const { return paragraph.text + "\n"; }
  std::string operator()(const report::Statement& statement) const {
    std::string out = toned(statement.tone, statement.word) + "\n" + statement.sentence + "\n";
    for (const std::string& remark : statement.remarks) out += "- " + remark + "\n";
    return out;
  }
  std::string operator()(const report::Table& table) const {
    std::string out;
    for (const auto& row : table.rows) {
      for (std::size_t i = 0; i < row.size(); ++i)
        out += (i == 0 ? "" : " | ") + toned(row[i].tone, row[i].text);
      out += "\n";
    }
    return out;
  }
  std::string operator()(const report::Chain& chain) const {
    std::string out;
    for (const auto& link : chain.links)
      out += "[" + link.title.text + ": " + toned(link.title.tone, link.answer) + "] " + link.text + "\n";
    return out;
  }
  std::string operator()(const report::Listing& listing) const {
    std::string out;
    for (const std::string& line : listing.lines) out += line + "\n";
    return out;
  }
  std::string operator()(const report::Picture& picture) const { return picture.caption + "\n"; }
  std::string operator()(const report::PageBreak& /*page_break*/) const { return ""; }

  static std::string toned(report::Tone tone, const std::string& text) {
    const std::string symbol(report::symbol_of(tone));
    return symbol.empty() ? text : symbol + " " + text;
  }
};

inline std::string text_of(const report::Document& document) {
  std::string out = document.title + "\n";
  for (const report::Block& block : document.blocks) out += std::visit(DocumentText{}, block);
  return out;
}

}  // namespace kiroku::test
