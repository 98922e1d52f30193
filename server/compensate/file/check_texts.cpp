#include "server/compensate/file/check_texts.h"

#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

#include "server/base/name_check.h"
#include "server/base/plain_text.h"

namespace trammel::model_file {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kLastTime = 253'402'300'799;  // Unix time, s: the end of the year 9999
constexpr char kJoins = '+';                         // batches that were trained together

std::size_t most_bytes(std::string_view key) {
  if (key == "level" || key == "kernel") return kMostSpellingBytes;
  if (key == "sentence" || key == "verdict") return kMostSentenceBytes;
  return kMostNameBytes;
}

Status check_batch_ids(std::string_view ids) {
  std::size_t batches = 0;
  for (bool is_last = false; !is_last;) {
    const std::size_t end = ids.find(kJoins);
    is_last = end == std::string_view::npos;
    TRY(check_name(ids.substr(0, end), "batch_id"));
    if (++batches > kMostBatches)
      return failure(ErrorCode::kTooLarge, "batch_id of more than {} batches, its limit",
                     kMostBatches)
          .of("batch_id")
          .beyond(batches, kMostBatches);
    if (!is_last) ids.remove_prefix(end + 1);
  }
  return {};
}

/// `key`: of the text, or of the list that it is in.
Status check_text(const std::string& text, const std::string& key) {
  if (key == "batch_id") return check_batch_ids(text);
  return check_name(text, key.c_str(), most_bytes(key));
}

Status check_all(const Json& json, const std::string& key) {
  if (json.is_string()) return check_text(json.get_ref<const std::string&>(), key);
  if (json.is_array()) {
    for (const Json& one : json) {
      if (!one.is_string() && !one.is_structured()) continue;  // most are numbers
      TRY(check_all(one, key));
    }
  }
  if (!json.is_object()) return {};
  static const std::set<std::string, std::less<>> kReadElsewhere = {"cell_yaml", "error_sources",
                                                                    "robot_yaml"};
  for (const auto& [name, one] : json.items()) {
    TRY(check_name(name, "key"));
    if (kReadElsewhere.contains(name)) continue;
    TRY(check_all(one, name));
  }
  return {};
}

Status check_times(const Json& stamp) {
  for (const char* key : {"trained_at", "measured_at"}) {
    if (!stamp.is_object() || !stamp.contains(key) || !stamp.at(key).is_number_integer()) continue;
    const double time = stamp.at(key).get<double>();
    if (time < 0 || time > static_cast<double>(kLastTime))
      return refused("{} is {:.0f} s of Unix time, limit 0 to {}", key, time, kLastTime)
          .of(key)
          .beyond(time, time < 0 ? 0.0 : static_cast<double>(kLastTime));
  }
  return {};
}

}  // namespace

Status check_texts(const Json& content, const Json& stamp) {
  Status fine = check_all(content, "content");
  if (fine) fine = check_all(stamp, "stamp");
  if (fine) fine = check_times(stamp);
  return fine;
}

}  // namespace trammel::model_file
