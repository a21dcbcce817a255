// What a document for people holds, apart from how it is drawn: made once, written as PDF (pdf_writer.h) and
// as HTML (html_writer.h). Plain values; texts are UTF-8 without control characters (plain_text()).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/bytes.h"
#include "base/utc_time.h"
#include "viewer/report/figure.h"
#include "viewer/report/language.h"

namespace kiroku::report {

/// How something stands. Never told by colour alone: every writer puts symbol_of() before the words.
enum class Tone { kPlain, kGood, kCaution, kBad };
/// "✓", "!", "✗"; "" for kPlain.
std::string_view symbol_of(Tone tone);

enum class Face { kText, kStrong, kMono };
enum class Alignment { kLeft, kRight };

/// Part of the document's outline. Level 1 or 2.
struct Heading {
  int level = 1;
  std::string text;
};

enum class ParagraphStyle { kBody, kSmall };
struct Paragraph {
  std::string text;
  ParagraphStyle style = ParagraphStyle::kBody;
};

/// The answer that the document gives, framed and large.
struct Statement {
  Tone tone = Tone::kPlain;
  std::string word;      // "INTACT"
  std::string sentence;  // what that means
  std::vector<std::string> remarks;
};

struct Cell {
  std::string text;
  Tone tone = Tone::kPlain;
  Face face = Face::kText;
};
struct Column {
  std::string title;
  double share = 1;  // of the width, relative to the other columns
  Alignment alignment = Alignment::kLeft;
};
/// Rows have as many cells as there are columns. Without any title there is no head, and the first cell of a
/// row is what the others are about.
struct Table {
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows;
};

/// Things of which each vouches for the one before, drawn in that order.
struct Chain {
  struct Link {
    Cell title;  // with the answer's tone
    std::string answer;
    std::string text;
    std::string bond;  // what ties it to the next: "hash of each file"; empty for the last
  };
  std::vector<Link> links;
};

/// Lines to be typed, or as a machine printed them.
struct Listing {
  std::vector<std::string> lines;
};

struct Picture {
  Figure figure;
  std::string caption;
};

/// What follows begins on a new page.
struct PageBreak {};

using Block = std::variant<Heading, Paragraph, Statement, Table, Chain, Listing, Picture, PageBreak>;

/// A file that a document carries along: what a reader needs to check by themselves what it tells of. A PDF
/// embeds it (ISO 32000-1, 7.11.4); a page for a browser does not.
struct Attachment {
  std::string name;         // "00000042.note"; UTF-8, without a folder, unique in its document
  std::string media_type;   // "application/timestamp-reply"
  std::string description;  // a phrase in the document's language
  Bytes bytes;
};

struct Document {
  Language language = Language::kEnglish;
  std::string title, subtitle;
  std::string subject, author, program;  // metadata; program: "kiroku 0.1.0"
  std::string running_head;              // at the top of each page, left of the case identifier
  std::string identifier;                // of the case
  std::string running_foot;              // at the bottom of each page, left of "1 of 5"
  UtcTime made;                          // also decides the dates of the PDF
  std::vector<Block> blocks;
  std::vector<Attachment> attachments;
};

/// Of a text from a case no more bytes than these are set: whoever made the case must not decide how long its
/// report takes, nor push the answers off the first page.
constexpr std::size_t kMostBytesOfText = 1'024;

/// Of a name that stands within a sentence.
constexpr std::size_t kMostBytesOfName = 100;

/// The text as printable() writes it (base/printable.h), cut off with "…" behind `most` bytes. For what comes
/// from a case, which somebody may have prepared.
std::string plain_text(std::string_view text, std::size_t most = kMostBytesOfText);

/// The text as one word of a shell, whoever chose it: in single quotes. Cut off like plain_text().
std::string shell_word(std::string_view text);

}  // namespace kiroku::report
