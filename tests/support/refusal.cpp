#include "tests/support/refusal.h"

#include <cmath>
#include <utility>

namespace trammel::test {
namespace {

std::string shown(const std::optional<double>& number) {
  return number ? fmt::format("{:.6g}", *number) : "";
}

std::string quoted(const std::string& text) { return fmt::format("{:?}", text); }

const char* name_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return "kUsage";
    case ErrorCode::kRefused:
      return "kRefused";
    case ErrorCode::kNotFound:
      return "kNotFound";
    case ErrorCode::kConflict:
      return "kConflict";
    case ErrorCode::kTooLarge:
      return "kTooLarge";
    case ErrorCode::kBusy:
      return "kBusy";
    case ErrorCode::kUnreachable:
      return "kUnreachable";
    case ErrorCode::kInternal:
      return "kInternal";
  }
  return "?";
}

}  // namespace

Refusal::Refusal(std::string file, std::optional<long> row, std::string field)
    : file_(std::move(file)), field_(std::move(field)), row_(row) {}

Refusal::Refusal(const Error& error)
    : code_(error.code),
      file_(error.file),
      field_(error.field),
      text_(error.text),
      row_(error.row),
      value_(error.value),
      limit_(error.limit) {}

Refusal Refusal::none() {
  Refusal none;
  none.refused_ = false;
  return none;
}

Refusal Refusal::of(ErrorCode code) const {
  Refusal changed = *this;
  changed.code_ = code;
  return changed;
}

Refusal Refusal::value(double is) const {
  Refusal changed = *this;
  changed.value_ = is;
  return changed;
}

Refusal Refusal::beyond(double is, double limit) const {
  Refusal changed = value(is);
  changed.limit_ = limit;
  return changed;
}

Refusal Refusal::text(std::string is) const {
  Refusal changed = *this;
  changed.text_ = std::move(is);
  return changed;
}

bool operator==(const Refusal& a, const Refusal& b) {
  return a.refused_ == b.refused_ && a.code_ == b.code_ && a.file_ == b.file_ &&
         a.field_ == b.field_ && a.text_ == b.text_ && a.row_ == b.row_ &&
         shown(a.value_) == shown(b.value_) && shown(a.limit_) == shown(b.limit_);
}

/// Prints it as a test writes it.
std::ostream& operator<<(std::ostream& out, const Refusal& refusal) {
  if (!refusal.refused_) return out << "Refusal::none()";
  out << "Refusal(" << quoted(refusal.file_);
  if (refusal.row_ || !refusal.field_.empty())
    out << ", " << (refusal.row_ ? std::to_string(*refusal.row_) : "{}");
  if (!refusal.field_.empty()) out << ", " << quoted(refusal.field_);
  out << ")";
  if (refusal.code_ != ErrorCode::kRefused)
    out << ".of(ErrorCode::" << name_of(refusal.code_) << ")";
  if (refusal.limit_) {
    out << ".beyond(" << shown(refusal.value_) << ", " << shown(refusal.limit_) << ")";
  } else if (refusal.value_) {
    out << ".value(" << shown(refusal.value_) << ")";
  }
  if (!refusal.text_.empty()) out << ".text(" << quoted(refusal.text_) << ")";
  return out;
}

}  // namespace trammel::test
