#include "clients/cli/files/recorded_calls.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

namespace trammel::cli {

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

double number(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

std::optional<double> known(const json& value) {
  return value.is_null() ? std::nullopt : std::optional(value.get<double>());
}

std::array<double, 3> three(const json& list) {
  return {number(list.at(0)), number(list.at(1)), number(list.at(2))};
}

exchange::Pose pose(const json& list) {
  return {three(list),
          {number(list.at(3)), number(list.at(4)), number(list.at(5)), number(list.at(6))}};
}

exchange::Approach approach(const json& item) {
  return {item.at("directions").get<std::vector<int>>(), known(item.at("temperature_c")),
          known(item.at("time_s"))};
}

RecordedPose pose_of(const json& item) {
  RecordedPose recorded{{item.at("joints_rad").get<std::vector<double>>(), approach(item)}, {}};
  recorded.answer.error_mm = three(item.at("error_mm"));
  recorded.answer.true_stddev_mm = three(item.at("true_stddev_mm"));
  recorded.answer.in_domain = item.at("in_domain").get<bool>();
  return recorded;
}

RecordedTarget target_of(const json& item) {
  RecordedTarget target;
  const auto kind = item.at("kind").get<std::string>();
  target.asked.joint_target = kind == "joints";
  target.asked.pose = pose(item.at("pose_mm"));
  if (kind == "pose_on_branch") target.asked.conf = item.at("conf").get<int>();
  target.asked.seed_rad = item.at("joints_rad").get<std::vector<double>>();
  target.asked.approach = approach(item);
  target.answer.status = item.at("status").get<std::string>();
  target.answer.commanded = pose(item.at("commanded_mm"));
  target.commanded_joints_rad = item.at("commanded_joints_rad").get<std::vector<double>>();
  target.answer.error_before_mm = number(item.at("error_before_mm"));
  target.answer.error_after_mm = number(item.at("error_after_mm"));
  target.answer.sigma_mm = number(item.at("sigma_mm"));
  return target;
}

RecordedCall call_of(const json& record) {
  RecordedCall call;
  call.at_unix_s = record.at("at_unix_s").get<std::int64_t>();
  call.trace = record.at("trace").get<std::string>();
  call.cell = record.at("cell").get<std::string>();
  call.tool = record.at("tool").get<std::string>();
  call.payload = record.at("payload").get<std::string>();
  call.model_id = record.at("model").at("id").get<std::string>();
  call.model_hash = record.at("model").at("hash").get<std::string>();
  call.model_version = record.at("model").at("version").get<int>();
  const bool predicts = record.at("operation").get<std::string>() == "predict";
  for (const json& item : record.at("items")) {
    if (predicts) {
      call.poses.push_back(pose_of(item));
    } else {
      call.targets.push_back(target_of(item));
    }
  }
  return call;
}

Result<RecordedCall> parse_record(const json& record) {
  try {
    if (record.at("record").get<int>() != 1) return refused("a record of another kind");
    return call_of(record);
  } catch (const json::exception&) {
    return refused("not a request that a service has recorded");
  }
}

/// The state of the reading so far.
struct ReadSoFar {
  std::size_t requests = 0;
  DamagedLines damaged;
};

Status read_file(const std::string& path, const std::function<Status(const RecordedCall&)>& take,
                 ReadSoFar& read) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return failure(ErrorCode::kRefused, "cannot be read").in(path);
  std::string text;
  for (long line = 1; std::getline(file, text); ++line) {
    const bool is_cut_off =
        file.eof();  // no end of line: it is being written, or the server was killed
    const json record = json::parse(text, nullptr, false);
    if (record.is_discarded() && is_cut_off) {
      if (!text.empty()) read.damaged.half.push_back(fmt::format("{} row {}", path, line));
      return {};
    }
    auto call = parse_record(record);
    if (!call) {
      if (read.damaged.count++ == 0)
        read.damaged.first = Failure(call.error()).in(path).at_row(line).value();
      continue;
    }
    ++read.requests;
    call->file = path;
    call->line = line;
    TRY(take(*call));
  }
  return {};
}

Result<std::vector<std::string>> files_of(const std::string& path) {
  std::error_code unknown;
  if (!fs::is_directory(path, unknown)) return std::vector{path};
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(path, unknown)) {
    if (entry.path().extension() == ".jsonl") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  if (files.empty()) return refused("no recorded requests there").in(path);
  return files;
}

}  // namespace

Result<DamagedLines> read_records(const std::string& path,
                                  const std::function<Status(const RecordedCall&)>& take) {
  const auto files = TRY(files_of(path));
  ReadSoFar read;
  for (const std::string& file : files) {
    TRY(read_file(file, take, read));
  }
  if (read.requests == 0 && read.damaged.count > 0) return tl::make_unexpected(read.damaged.first);
  return read.damaged;
}

}  // namespace trammel::cli
