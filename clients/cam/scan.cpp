#include "clients/cam/scan.h"

#include "server/base/letters.h"

namespace trammel::cam {

namespace {

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '$' ||
         static_cast<unsigned char>(c) >= 0x80;
}

class Scanner {
 public:
  Scanner(std::string_view text, std::size_t begin, std::size_t end, int line,
          const ScanOptions& options)
      : text_(text.substr(0, end)), at_(begin), line_(line), options_(options) {}

  std::vector<Piece> all() {
    std::vector<Piece> pieces;
    while (skip_blanks()) {
      const bool after_value = !pieces.empty() && pieces.back().end == at_ &&
                               (pieces.back().kind != Piece::Kind::kSign || pieces.back().is(")") ||
                                pieces.back().is("]"));
      pieces.push_back(next(after_value));
    }
    return pieces;
  }

 private:
  [[nodiscard]] char peek(std::size_t ahead = 0) const {
    return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0';
  }

  /// Whether there is anything left.
  bool skip_blanks() {
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (!options_.comment.empty() && text_.substr(at_).starts_with(options_.comment)) {
        const std::size_t end = text_.find('\n', at_);
        if (end == std::string_view::npos) return false;
        at_ = end;
      } else if (c != ' ' && c != '\t' && c != '\r' && c != '\n' && c != '\f' && c != '\0') {
        return true;
      }
      if (text_[at_] == '\n') ++line_;
    }
    return false;
  }

  Piece next(bool after_value) {
    Piece piece{Piece::Kind::kSign, at_, at_ + 1, line_, {}};
    const char c = text_[at_];
    const bool is_signed = (c == '-' || c == '+') && !after_value;
    const std::size_t first = is_signed ? 1 : 0;
    if (is_digit(peek(first)) || (peek(first) == '.' && is_digit(peek(first + 1)))) {
      piece.kind = Piece::Kind::kNumber;
      piece.end = number_end(at_ + first);
    } else if (is_letter(c)) {
      piece.kind = Piece::Kind::kWord;
      while (piece.end < text_.size() &&
             (is_letter(text_[piece.end]) || is_digit(text_[piece.end])))
        ++piece.end;
    } else if (options_.quotes.find(c) != std::string_view::npos) {
      piece.kind = Piece::Kind::kText;
      while (piece.end < text_.size() && text_[piece.end] != c && text_[piece.end] != '\n')
        ++piece.end;
      if (piece.end < text_.size() && text_[piece.end] == c) ++piece.end;
    }
    piece.text = text_.substr(at_, piece.end - at_);
    at_ = piece.end;
    return piece;
  }

  std::size_t number_end(std::size_t at) const {
    const auto digit = [&](std::size_t i) { return i < text_.size() && is_digit(text_[i]); };
    while (digit(at)) ++at;
    if (at < text_.size() && text_[at] == '.') ++at;
    while (digit(at)) ++at;
    if (at < text_.size() && (text_[at] == 'e' || text_[at] == 'E')) {
      const std::size_t sign =
          at + 1 < text_.size() && (text_[at + 1] == '+' || text_[at + 1] == '-') ? 2 : 1;
      if (digit(at + sign)) {
        at += sign;
        while (digit(at)) ++at;
      }
    }
    return at;
  }

  std::string_view text_;
  std::size_t at_;
  int line_;
  ScanOptions options_;
};

}  // namespace

std::vector<Piece> pieces_of(std::string_view text, std::size_t begin, std::size_t end, int line,
                             const ScanOptions& options) {
  return Scanner(text, begin, end, line, options).all();
}

}  // namespace trammel::cam
