#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "server/metrics/operation_counts.h"

namespace trammel {

/// `ok`, `deadline_missed`.
[[nodiscard]] const char* result_word(std::size_t code);
/// The number of answers by the word of the result code: `ok`, `deadline_missed`. Words without a
/// count are left out, `ok` is always there.
[[nodiscard]] std::map<std::string, std::uint64_t> by_result_words(const OperationCounts& counts);

}  // namespace trammel
