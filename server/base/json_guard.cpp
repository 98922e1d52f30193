#include "server/base/json_guard.h"

#include <algorithm>
#include <cstdint>
#include <optional>

namespace trammel {
namespace {

constexpr std::string_view kBlank = " \t\r\n";
constexpr std::string_view kEndsScalar = " \t\r\n,:[]{}\"";

enum class Piece { kEnd, kOpen, kClose, kText, kScalar, kColon, kComma };

struct Token {
  Piece piece = Piece::kEnd;
  std::size_t begin = 0, end = 0;
};

/// Reads the text token by token and keeps counts only.
class Scanner {
 public:
  Scanner(std::string_view json, const std::string& where, const JsonLimits& limits)
      : json_(json), where_(where), limits_(limits) {}

  Result<Token> next() {
    const std::size_t begin = std::min(json_.find_first_not_of(kBlank, at_), json_.size());
    at_ = begin;
    if (begin == json_.size()) return Token{Piece::kEnd, begin, begin};
    const Piece piece = piece_of(json_[begin]);
    at_ = piece == Piece::kText     ? end_of_text(begin)
          : piece == Piece::kScalar ? end_of_scalar(begin)
                                    : begin + 1;
    const Token token{piece, begin, at_};
    if (const Status counted = count(token); !counted) return tl::make_unexpected(counted.error());
    return token;
  }

  [[nodiscard]] std::size_t depth() const { return depth_; }

 private:
  static Piece piece_of(char c) {
    switch (c) {
      case '[':
      case '{':
        return Piece::kOpen;
      case ']':
      case '}':
        return Piece::kClose;
      case '"':
        return Piece::kText;
      case ':':
        return Piece::kColon;
      case ',':
        return Piece::kComma;
      default:
        return Piece::kScalar;
    }
  }

  /// The position behind the closing quote; the end of the text if there is none.
  [[nodiscard]] std::size_t end_of_text(std::size_t begin) const {
    for (std::size_t i = begin + 1; i < json_.size(); ++i) {
      if (json_[i] == '"') return i + 1;
      if (json_[i] == '\\') ++i;
    }
    return json_.size();
  }

  [[nodiscard]] std::size_t end_of_scalar(std::size_t begin) const {
    return std::min(json_.find_first_of(kEndsScalar, begin), json_.size());
  }

  Status count(const Token& token) {
    const std::size_t bytes = token.end - token.begin;
    switch (token.piece) {
      case Piece::kOpen:
        return within("arrays and objects inside one another", ++depth_, limits_.depth)
            .and_then(
                [this] { return within("arrays and objects", ++containers_, limits_.containers); });
      case Piece::kClose:
        if (depth_ == 0)
          return refused("not JSON: byte {} closes what was not opened", token.begin).in(where_);
        --depth_;
        return {};
      case Piece::kText:
        return within("bytes in one text", bytes, limits_.text_bytes).and_then([this] {
          return one_more_value();
        });
      case Piece::kScalar:
        return within("bytes in one number", bytes, limits_.scalar_bytes).and_then([this] {
          return one_more_value();
        });
      case Piece::kColon:
        return within("keys", ++members_, limits_.members);
      default:
        return {};
    }
  }

  Status one_more_value() { return within("values", ++values_, limits_.values); }

  Status within(const char* what, std::size_t count, std::size_t limit) const {
    if (count <= limit) return {};
    return failure(ErrorCode::kTooLarge, "{} {}, limit {}", count, what, limit)
        .in(where_)
        .beyond(count, limit);
  }

  std::string_view json_;
  const std::string& where_;
  const JsonLimits& limits_;
  std::size_t at_ = 0, depth_ = 0, values_ = 0, containers_ = 0, members_ = 0;
};

Status check_size(std::string_view json, const std::string& where, const JsonLimits& limits) {
  if (json.size() <= limits.bytes) return {};
  return failure(ErrorCode::kTooLarge, "{} bytes, limit {}", json.size(), limits.bytes)
      .in(where)
      .beyond(json.size(), limits.bytes);
}

/// Collects the members of the outermost object, token by token.
class Members {
 public:
  Members(std::string_view json, const std::string& where) : json_(json), where_(where) {}

  /// `depth` is the nesting depth after the token.
  Status take(const Token& token, std::size_t depth) {
    if (!opened_) {
      opened_ = true;
      if (token.piece == Piece::kOpen && json_[token.begin] == '{') return {};
      return no_object();
    }
    if (closed_) return no_object();
    const bool top = depth == 1 && token.piece != Piece::kClose;
    if (top && (token.piece == Piece::kComma || token.piece == Piece::kColon))
      return separate(token);
    if (depth == 0) {
      closed_ = true;
      if (json_[token.begin] != '}') return no_object();
      const bool empty = found_.empty() && !key_ && !begin_;
      return empty ? Status() : end_member();
    }
    if (!begin_) begin_ = token.begin;
    end_ = token.end;
    return {};
  }

  Result<std::map<std::string, std::string_view>> result() && {
    if (!closed_) return tl::make_unexpected(no_object().error());
    return std::move(found_);
  }

 private:
  Status separate(const Token& token) {
    if (token.piece == Piece::kComma) return end_member();
    if (key_ || !begin_) return no_object();
    const std::string_view text = json_.substr(*begin_, end_ - *begin_);
    if (text.size() < 2 || text.front() != '"' || text.find('\\') != std::string_view::npos)
      return no_object();
    key_ = std::string(text.substr(1, text.size() - 2));
    begin_.reset();
    return {};
  }

  Status end_member() {
    if (!key_ || !begin_) return no_object();
    if (!found_.emplace(*key_, json_.substr(*begin_, end_ - *begin_)).second) {
      return refused("not JSON: the key {} comes twice", *key_).in(where_).of(*key_);
    }
    key_.reset();
    begin_.reset();
    return {};
  }

  [[nodiscard]] Status no_object() const {
    return refused("not a JSON object with keys and values").in(where_);
  }

  std::string_view json_;
  const std::string& where_;
  std::map<std::string, std::string_view> found_;
  std::optional<std::string> key_;
  std::optional<std::size_t> begin_;  // of the current key or value
  std::size_t end_ = 0;
  bool opened_ = false, closed_ = false;
};

}  // namespace

Status check_json_limits(std::string_view json, const std::string& where,
                         const JsonLimits& limits) {
  TRY(check_size(json, where, limits));
  Scanner scanner(json, where, limits);
  while (true) {
    const Result<Token> token = scanner.next();
    if (!token) return tl::make_unexpected(token.error());
    if (token->piece == Piece::kEnd) return {};
  }
}

Result<std::map<std::string, std::string_view>> json_members(std::string_view json,
                                                             const std::string& where,
                                                             const JsonLimits& limits) {
  // The limits are checked before anything is stored.
  if (const Status fine = check_json_limits(json, where, limits); !fine)
    return tl::make_unexpected(fine.error());
  Scanner scanner(json, where, limits);
  Members members(json, where);
  while (true) {
    const Result<Token> token = scanner.next();
    if (!token) return tl::make_unexpected(token.error());
    if (token->piece == Piece::kEnd) return std::move(members).result();
    if (const Status taken = members.take(*token, scanner.depth()); !taken)
      return tl::make_unexpected(taken.error());
  }
}

}  // namespace trammel
