#include "idl/repairs/cdr_walk.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/base/plain_text.h"

namespace trammel::wire {
namespace {

constexpr std::size_t kEncapsulation = 4;
constexpr std::size_t kMostPadding = 3;

}  // namespace

bool is_token(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c > 0x20 && c < 0x7f; });
}

Fault fault_of_contract(std::uint32_t contract_version) {
  Fault fault{RESULT_WRONG_CONTRACT, {}, {}, "contract_version", {}, {}};
  fault.what =
      fmt::format("the request is of contract {}, this server speaks contract {}: update the {}",
                  contract_version, CONTRACT_VERSION,
                  contract_version < CONTRACT_VERSION ? "client" : "server");
  fault.value = contract_version;
  fault.limit = CONTRACT_VERSION;
  return fault;
}

CdrWalk::CdrWalk(std::span<const unsigned char> sample) {
  if (sample.size() < kEncapsulation || sample[0] != 0 || sample[1] > 1) {
    fail(RESULT_MALFORMED, "the sample is not plain CDR", "");
    return;
  }
  little_endian_ = sample[1] == 1;
  sample_ = sample.subspan(kEncapsulation);
}

void CdrWalk::align(std::size_t bytes) {
  const std::size_t over = at_ % bytes;
  if (over != 0) at_ = std::min(sample_.size(), at_ + bytes - over);
}

void CdrWalk::skip(std::size_t count, std::size_t bytes) {
  if (fault_ || count == 0) return;
  align(bytes);
  if (left() / bytes < count) return fail(RESULT_MALFORMED, "the sample ends too early", "");
  at_ += count * bytes;
}

std::uint32_t CdrWalk::number(const char* field) {
  if (fault_) return 0;
  align(4);
  if (left() < 4) {
    fail(RESULT_MALFORMED, "the sample ends too early", field);
    return 0;
  }
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= std::uint32_t{sample_[at_ + i]} << (8 * (little_endian_ ? i : 3 - i));
  at_ += 4;
  return value;
}

void CdrWalk::flag(const char* field) {
  if (fault_) return;
  if (left() < 1) return fail(RESULT_MALFORMED, "the sample ends too early", field);
  if (sample_[at_] > 1)
    return fail(RESULT_MALFORMED, fmt::format("{} is no boolean", int{sample_[at_]}), field);
  ++at_;
}

void CdrWalk::enumerator(const char* field, std::uint32_t last) {
  const std::uint32_t value = number(field);
  if (fault_ || value <= last) return;
  fail(RESULT_INVALID_ARGUMENT,
       fmt::format("{} {} does not exist, the last one is {}", field, value, last), field);
  fault_->value = value;
  fault_->limit = last;
}

void CdrWalk::text(const char* field, std::size_t most_bytes, Text kind) {
  const std::uint32_t length = number(field);
  if (fault_) return;
  if (length > left()) return fail(RESULT_MALFORMED, "the sample ends too early", field);
  const std::string_view with_end(reinterpret_cast<const char*>(sample_.data()) + at_, length);
  at_ += length;
  // The length counts a NUL at the end; some leave an empty text without it.
  const std::string_view text = length == 0 ? with_end : with_end.substr(0, length - 1);
  if (length > 0 && with_end.back() != '\0')
    return fail(RESULT_MALFORMED, "a text without its end", field);
  if (text.size() > most_bytes)
    return fail_beyond(fmt::format("{} of {} bytes, limit {}", field, text.size(), most_bytes),
                       field, text.size(), most_bytes);
  if (text.find('\0') != std::string_view::npos)
    return fail(RESULT_REFUSED, fmt::format("{} has a NUL byte, it is no text", field), field);
  if (kind == Text::kToken && !is_token(text))
    return fail(RESULT_REFUSED, fmt::format("{} must be printable ASCII without spaces", field),
                field);
  if (kind == Text::kPlain && !is_plain(text))
    return fail(
        RESULT_REFUSED,
        fmt::format("{} '{}' must be UTF-8 without control characters", field, shown_short(text)),
        field);
}

std::size_t CdrWalk::list(const char* field, std::size_t most, std::size_t least_bytes) {
  const std::size_t count = number(field);
  if (fault_) return 0;
  if (count > most) {
    fail_beyond(fmt::format("{} {} in one request, limit {}", count, field, most), field, count,
                most);
    return 0;
  }
  if (count > left() / least_bytes) {
    fail(RESULT_MALFORMED, "the sample ends too early", field);
    return 0;
  }
  return count;
}

void CdrWalk::end() {
  if (fault_ || left() <= kMostPadding) return;
  fail(RESULT_MALFORMED, fmt::format("{} bytes follow the last member", left()), "");
}

void CdrWalk::fail(ResultCode code, std::string what, const char* field) {
  if (fault_) return;
  fault_ = Fault{code, std::move(what), {}, field, {}, {}};
  if (item_ > 0) fault_->where = fmt::format("{} {}", item_name_, item_);
}

void CdrWalk::fail_beyond(std::string what, const char* field, std::size_t value,
                          std::size_t limit) {
  fail(RESULT_TOO_LARGE, std::move(what), field);
  fault_->value = static_cast<double>(value);
  fault_->limit = static_cast<double>(limit);
}

}  // namespace trammel::wire
