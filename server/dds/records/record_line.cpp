#include <array>
#include <cmath>

#include "idl/exchange/wire_values.h"
#include "server/dds/records/request_recorder.h"

namespace trammel {
namespace {

/// JSON has no NaN: an unknown number is null.
std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "null";
}

std::string text(const std::string& value) {
  std::string escaped = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') escaped += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      escaped += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      escaped += c;
    }
  }
  return escaped + '"';
}

template <typename Numbers>
std::string list(const Numbers& numbers) {
  std::string all = "[";
  for (const auto value : numbers) {
    if (all.size() > 1) all += ',';
    all += number(static_cast<double>(value));
  }
  return all + "]";
}

std::string pose(const wire::PoseMm& X) {
  const auto& [p, q] = wire::from_wire(X);
  return list(std::array{p[0], p[1], p[2], q[0], q[1], q[2], q[3]});
}

std::string approach(const wire::Approach& approach) {
  return fmt::format("\"directions\":{},\"temperature_c\":{},\"time_s\":{}",
                     list(approach.directions()), number(approach.temperature_c()),
                     number(approach.time_s()));
}

/// The beginning of all records.
template <typename Request, typename Reply>
std::string beginning(const char* operation, const Request& request, const Reply& reply,
                      std::int64_t at_unix_s) {
  return fmt::format(
      "{{\"record\":1,\"operation\":\"{}\",\"at_unix_s\":{},\"trace\":{},\"cell\":{},\"tool\":{},"
      "\"payload\":{},\"model\":{{\"id\":{},\"hash\":{},\"version\":{}}},\"items\":[",
      operation, at_unix_s, text(request.header().trace_id().to_string()),
      text(request.about().cell()), text(request.about().tool()), text(request.about().payload()),
      text(reply.model().id()), text(reply.model().hash()), reply.model().version());
}

std::string item(const wire::CommandedJoints& asked, const wire::PredictedError& answer) {
  const exchange::Prediction prediction = wire::from_wire(answer);
  return fmt::format(
      "{{\"joints_rad\":{},{},\"error_mm\":{},\"stddev_mm\":{},\"true_stddev_mm\":{},\"turn_rad\":{"
      "},\"in_domain\":{}}}",
      list(asked.joints_rad()), approach(asked.approach()), list(prediction.error_mm),
      list(prediction.stddev_mm), list(prediction.true_stddev_mm),
      list(std::array{answer.rx_rad(), answer.ry_rad(), answer.rz_rad()}), answer.in_domain());
}

std::string item(const wire::Target& asked, const wire::CorrectedTarget& answer) {
  constexpr std::array kKinds = {"pose_near_joints", "pose_on_branch", "joints"};
  return fmt::format(
      "{{\"kind\":\"{}\",\"pose_mm\":{},\"joints_rad\":{},\"conf\":{},{},\"status\":\"{}\","
      "\"commanded_mm\":{},\"commanded_joints_rad\":{},\"error_before_mm\":{},\"error_after_mm\":{}"
      ",\"sigma_mm\":{}}}",
      kKinds.at(static_cast<std::size_t>(asked.kind())), pose(asked.pose()),
      list(asked.joints_rad()), asked.conf(), approach(asked.approach()),
      wire::word_of(answer.status()), pose(answer.commanded()), list(answer.joints_rad()),
      number(answer.error_before_mm()), number(answer.error_after_mm()), number(answer.sigma_mm()));
}

template <typename Asked, typename Answers>
std::string items(const Asked& asked, const Answers& answers) {
  std::string all;
  for (std::size_t i = 0; i < std::min(asked.size(), answers.size()); ++i) {
    if (i > 0) all += ',';
    all += item(asked[i], answers[i]);
  }
  return all;
}

}  // namespace

std::string record_line(const wire::PredictErrorRequest& request,
                        const wire::PredictErrorReply& reply, std::int64_t at_unix_s) {
  return beginning("predict", request, reply, at_unix_s) +
         items(request.poses(), reply.predictions()) + "]}";
}

std::string record_line(const wire::CorrectTargetRequest& request,
                        const wire::CorrectTargetReply& reply, std::int64_t at_unix_s) {
  return beginning("correct", request, reply, at_unix_s) +
         items(request.targets(), reply.corrections()) + "]}";
}

}  // namespace trammel
