#include "server/dds/result_words.h"

#include <array>

#include "idl/topics.h"

namespace trammel {
namespace {

/// In the order of wire::ResultCode.
constexpr std::array kWords = {
    "ok",        "unsupported", "invalid_argument", "out_of_resources", "unknown_operation",
    "exception", "refused",     "not_found",        "conflict",         "too_large",
    "busy",      "internal",    "wrong_contract",   "deadline_missed",  "wrong_identity",
    "malformed"};
static_assert(kWords.size() == wire::RESULT_MALFORMED + 1 &&
              kWords.size() <= OperationCounts::kResults);

}  // namespace

const char* result_word(std::size_t code) {
  return code < kWords.size() ? kWords[code] : "unknown";
}

std::map<std::string, std::uint64_t> by_result_words(const OperationCounts& counts) {
  std::map<std::string, std::uint64_t> by_word;
  for (std::size_t code = 0; code < kWords.size(); ++code) {
    const std::uint64_t count = counts.of_result(code);
    if (count > 0 || code == wire::RESULT_OK) by_word[kWords[code]] = count;
  }
  return by_word;
}

}  // namespace trammel
