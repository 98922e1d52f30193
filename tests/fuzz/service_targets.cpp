// Messages that come over the wire: every type, every request with its handler, what a session
// makes of replies; and the server file.
#include <array>
#include <filesystem>
#include <memory>
#include <type_traits>
#include <utility>

#include "clients/cli/text/diagnose_text.h"
#include "clients/session/convert.h"
#include "idl/exchange/wire_values.h"
#include "idl/limits.h"
#include "idl/repairs/guard/guard.h"
#include "idl/repairs/safe_type.h"
#include "idl/topics.h"
#include "idl/transport/ros2.h"
#include "server/base/check.h"
#include "server/base/json_guard.h"
#include "server/base/text_file.h"
#include "server/config/server_config.h"
#include "server/dds/handlers.h"
#include "server/dds/ros2/translated.h"
#include "server/simulate/simulate.h"
#include "tests/dds/backend.h"
#include "tests/fuzz/target.h"
#include "tests/support/rtps_packet.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::fuzz {
namespace {

using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

template <typename PubSubType>
std::string bytes_of(typename PubSubType::type& sample) {
  PubSubType type;
  Payload payload(type.getSerializedSizeProvider(&sample)());
  TRAMMEL_CHECK(type.serialize(&sample, &payload));
  return {reinterpret_cast<const char*>(payload.data), payload.length};
}

/// The sample in these bytes; empty where the type drops them.
template <typename PubSubType>
std::optional<typename PubSubType::type> sample_of(std::string_view bytes, std::size_t most) {
  wire::SafeType<PubSubType> type(most);
  Payload payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  typename PubSubType::type sample;
  if (!type.deserialize(&payload, &sample)) return std::nullopt;
  return sample;
}

/// Reads the parts of a reply or a state as a session would.
template <typename Sample>
void convert(const Sample& sample) {
  if constexpr (requires { client::error_of(sample.header()); })
    static_cast<void>(client::error_of(sample.header()));
  if constexpr (requires { client::from_wire(sample.model()); })
    static_cast<void>(client::from_wire(sample.model()));
  if constexpr (requires { sample.jobs(); }) {
    for (const auto& one : sample.jobs()) static_cast<void>(client::from_wire(one, "server-1"));
  }
  if constexpr (requires { sample.batches(); }) {
    for (const auto& one : sample.batches()) static_cast<void>(client::from_wire(one));
  }
  if constexpr (requires { client::from_wire(sample); })
    static_cast<void>(client::from_wire(sample));
  if constexpr (requires { sample.predictions(); }) {
    for (const auto& one : sample.predictions()) static_cast<void>(wire::from_wire(one));
  }
  if constexpr (requires { sample.corrections(); }) {
    for (const auto& one : sample.corrections()) static_cast<void>(wire::from_wire(one, {}));
  }
}

/// A sample that is taken can be sent again.
template <typename PubSubType>
std::string read_sample(std::string_view bytes) {
  auto sample = sample_of<PubSubType>(bytes, wire::kMaxComputeSample);
  if (!sample) return "dropped";
  convert(*sample);
  static_cast<void>(bytes_of<PubSubType>(*sample));
  eprosima::fastrtps::rtps::InstanceHandle_t key;
  wire::SafeType<PubSubType> type(wire::kMaxComputeSample);
  if (type.m_isGetKeyDefined) static_cast<void>(type.getKey(&*sample, &key, false));
  return "taken";
}

/// With everything in it that a request or reply of this type may have.
template <typename Sample>
void fill(Sample& sample) {
  if constexpr (requires { sample.header().reply_partition("client-1"); })
    sample.header().reply_partition("client-1");
  if constexpr (requires { sample.header().contract_version(wire::CONTRACT_VERSION); })
    sample.header().contract_version(wire::CONTRACT_VERSION);
  if constexpr (requires { sample.about().cell("cell-7"); }) sample.about().cell("cell-7");
  if constexpr (requires { sample.poses().resize(3); }) {
    sample.poses().resize(3);
    for (auto& pose : sample.poses()) pose.joints_rad({0.1, 0.2, 0.3, 0.4, 0.5, 0.6});
    sample.poses()[1].approach().directions({0, 1, 0, -1, 0, 0});
  }
  if constexpr (requires { sample.targets().resize(3); }) {
    sample.targets().resize(3);
    for (auto& target : sample.targets()) target.joints_rad({0.1, 0.2, 0.3, 0.4, 0.5, 0.6});
    sample.targets()[1].kind(wire::TARGET_JOINTS);
  }
  if constexpr (requires { sample.predictions().resize(3); }) sample.predictions().resize(3);
  if constexpr (requires { sample.corrections().resize(3); }) sample.corrections().resize(3);
  if constexpr (requires { sample.models().resize(2); }) sample.models().resize(2);
  if constexpr (requires { sample.cells().resize(3); }) sample.cells().resize(3);
  if constexpr (requires { sample.batch_ids().resize(2); }) sample.batch_ids() = {"a", "b"};
  if constexpr (requires { sample.batch_id("a"); }) sample.batch_id("a");
  if constexpr (requires { sample.csv("q1_deg"); }) sample.csv("q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n");
  if constexpr (requires { sample.model_text("text"); }) sample.model_text("{}");
  if constexpr (requires { sample.text("text"); }) sample.text("{}");
  if constexpr (requires { sample.jobs().resize(2); }) sample.jobs().resize(2);
  if constexpr (requires { sample.batches().resize(2); }) sample.batches().resize(2);
}

template <typename PubSubType>
std::vector<std::string> samples() {
  typename PubSubType::type empty, full;
  fill(full);
  if constexpr (requires { empty.header().reply_partition("client-1"); })
    empty.header().reply_partition("client-1");
  return {bytes_of<PubSubType>(empty), bytes_of<PubSubType>(full)};
}

/// A request for each value of the enumeration that says what is wanted.
template <typename Operation, typename Set>
std::vector<std::string> of_each(int last, const Set& set) {
  using Type = typename Operation::Request;
  std::vector<std::string> all = samples<Type>();
  for (int value = 0; value <= last; ++value) {
    typename Type::type sample;
    fill(sample);
    set(sample, value);
    all.push_back(bytes_of<Type>(sample));
  }
  return all;
}
std::vector<std::string> manage_samples() {
  return of_each<wire::ManageModels>(wire::MANAGE_BACKUP,
                                     [](wire::ManageModelsRequest& request, int action) {
                                       request.action(static_cast<wire::ManageAction>(action));
                                     });
}
std::vector<std::string> read_samples() {
  return of_each<wire::ReadModels>(wire::READ_REPLAY,
                                   [](wire::ReadModelsRequest& request, int what) {
                                     request.what(static_cast<wire::ReadKind>(what));
                                   });
}
std::vector<std::string> release_samples() {
  return of_each<wire::ReleaseBatches>(wire::RELEASE_DISCARD,
                                       [](wire::ReleaseBatchesRequest& request, int action) {
                                         request.action(static_cast<wire::ReleaseAction>(action));
                                       });
}

/// A server without its network, with a model in force and a trainer that takes jobs and does none
/// of them.
struct Service {
  Service() { backend.serve(1); }
  test::Backend backend;
  Handlers handlers{*backend.trainer, *backend.store, backend.registry};
};
Service& service() {
  static Service one;
  return one;
}

/// The answer of the handler, if the request comes through.
template <typename Operation>
std::string ask(std::string_view bytes) {
  const auto request = sample_of<typename Operation::Request>(bytes, Operation::kMaxSample);
  if (!request) return "dropped";
  auto reply = service().handlers.answer(*request);
  if (!reply) return words_of(reply.error());
  static_cast<void>(bytes_of<typename Operation::Reply>(*reply));
  return "answered";
}

/// The answer to the question of a ROS 2 node, as the node gets it.
template <typename Ros>
std::string ask_as_node(std::string_view bytes) {
  wire::ReceivedMessageType<typename Ros::Request> type(
      wire::kMaxComputeSample, std::make_shared<std::atomic<std::uint64_t>>(0));
  Payload payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  wire::ReceivedMessage<typename Ros::Request::type> message;
  if (!type.deserialize(&payload, &message)) return "dropped";
  const ServedCells& cells = service().backend.trainer->cells();
  const auto request = ros2::asked(message, cells);
  if (request->fault) return "refused";
  auto reply = service().handlers.answer(*request);
  if (!reply) return words_of(reply.error());
  auto answer = ros2::answered(*reply, cells);
  static_cast<void>(bytes_of<typename Ros::Reply>(answer));
  return "answered";
}
std::vector<std::string> node_predictions() {
  wire::ros2::PredictErrors_ question;
  question.id("node/1");
  question.cell("cell-7");
  question.joints(6);
  question.joints_rad(std::vector<double>(18, 0.1));
  return {bytes_of<wire::Ros2PredictErrors::Request>(question)};
}
std::vector<std::string> node_corrections() {
  wire::ros2::CorrectTargets_ near, on_branch;
  near.id("node/2");
  near.cell("cell-7");
  near.joints(6);
  near.joints_rad(std::vector<double>(12, 0.1));
  on_branch.id("node/3");
  on_branch.cell("cell-7");
  on_branch.poses().resize(2);
  for (auto& pose : on_branch.poses()) pose.orientation().w(1);
  on_branch.conf({0, 3});
  return {bytes_of<wire::Ros2CorrectTargets::Request>(near),
          bytes_of<wire::Ros2CorrectTargets::Request>(on_branch)};
}

/// In a folder with the cell files that it names.
std::string read_server_file(std::string_view bytes) {
  static const test::TemporaryFolder folder;
  static const bool written = [] {
    folder.write("robot.yaml", test::small_robot_yaml());
    folder.write("cell-7.yaml", test::small_cell_yaml("cell-7"));
    return true;
  }();
  TRAMMEL_CHECK(written);
  const auto config = read_server_config(folder.write("server.yaml", std::string(bytes)));
  return config ? "taken" : words_of(config.error());
}
std::vector<std::string> server_files() {
  return {
      "version: 1\nserver: a\ncells: [cell-7.yaml]\nstore: t.db\n"
      "dds: {domain: 3, address: 127.0.0.1, port: 17500, compute_workers: 2, max_clients: 9}\n"
      "trainer: {queue_capacity: 4, max_poses: 2000, validation_share: 0.2, accept_ratio: 1.05, "
      "seed: 1}\n"
      "log: {level: info, file: log.txt}\n"};
}

/// Reads the findings of a server as the command line tells them.
std::string read_findings(std::string_view bytes) {
  const std::string text(bytes);
  if (const Status small = check_json_limits(text, "findings"); !small)
    return words_of(small.error());
  try {
    const auto json = nlohmann::ordered_json::parse(text, nullptr, false);
    if (!json.is_object()) return "no object";
    static_cast<void>(cli::diagnosis_text(json));
    if (!json.at("next_poses").empty()) static_cast<void>(cli::next_poses_csv(json));
    return "told";
  } catch (const nlohmann::json::exception& error) {
    return fmt::format("no diagnosis {}", error.id);
  }
}

/// The truth of a virtual robot.
std::string read_truth_file(std::string_view bytes) {
  static const test::TemporaryFolder folder;
  const auto robot =
      read_virtual_robot(folder.write("truth.yaml", std::string(bytes)), service().backend.cell);
  return robot ? "taken" : words_of(robot.error());
}
std::vector<std::string> truths() {
  return {
      "version: 1\nerror_sources:\n  base: {x0_mm: 1.5}\n  gear_transmission:3@11: {}\n"
      "noise: {sigma_mm: 0.01, sigma_deg: 0.001}\nbase: {xyz_mm: [0, 0, 1], q_wxyz: [1, 0, 0, 0]}\n"
      "tools: {spindle: {xyz_mm: [1, 2, 3]}}\n"
      "course: {seconds_per_pose: 10, temperature_c: [20, 30], time_constant_s: 3600}\n"};
}

template <typename PubSubType>
Target type_target(const char* name) {
  return {name, read_sample<PubSubType>, mutate_cdr, samples<PubSubType>};
}
template <typename Operation>
Target request_target(const char* name) {
  return {name, ask<Operation>, mutate_cdr, samples<typename Operation::Request>};
}

/// Gives a packet to the guard; what passes must be whole.
std::string guard_packet(std::string_view bytes) {
  static wire::Guard guard(
      static_cast<std::uint32_t>(wire::kMaxTextSample));  // remembers what it has seen
  static std::array<std::uint64_t, wire::kDroppedReasons> before{};
  const wire::Bytes packet(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  guard.sent(packet);
  const auto passed = guard.check(packet, 1);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto reason = static_cast<wire::Dropped>(i);
    if (std::exchange(before[i], guard.counts().of(reason)) != guard.counts().of(reason))
      return wire::name_of(reason);
  }
  TRAMMEL_CHECK(passed.has_value());
  wire::Bytes rest = passed->subspan(wire::kHeaderBytes);
  while (!rest.empty()) TRAMMEL_CHECK(wire::next_submessage(rest).has_value());
  return passed->size() == packet.size() ? "passes" : "passes in part";
}

std::vector<std::string> packets() {
  constexpr test::Prefix kFrom = {1, 15, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
  constexpr std::uint32_t kWriter = 0x00000103, kReader = 0x00000104;
  test::ParameterList list;
  list.guid(0x0050, kFrom, 0x000001c1)
      .text(0x0062, "name")
      .locator(0x0032, 7)
      .add(0x002c, {4, 0, 0, 0, 1, 2, 3, 4});
  const std::vector<test::PacketBytes> all = {
      test::Packet(kFrom).data({0, wire::kAnnouncer, 1, {}, list.payload()}).bytes(),
      test::Packet(kFrom)
          .to(kFrom)
          .data({0, kWriter, 1, {}, {0, 1, 0, 0}})
          .heartbeat(0, kWriter, 1, 1, 1)
          .bytes(),
      test::Packet(kFrom).gap(0, kWriter, 2, 9).acknack(kReader, kWriter, 2, 40, 1).bytes(),
      test::Packet(kFrom).fragments({0, kWriter, 3, 1, 1, 64, 256, test::PacketBytes(64)}).bytes(),
      test::Packet(kFrom).nack_frag(kReader, kWriter, 3, 2, 1).bytes()};
  std::vector<std::string> seeds;
  for (const test::PacketBytes& one : all) seeds.emplace_back(one.begin(), one.end());
  return seeds;
}

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all = {
      type_target<wire::PredictError::Request>("predict_error_request"),
      type_target<wire::PredictError::Reply>("predict_error_reply"),
      type_target<wire::CorrectTarget::Request>("correct_target_request"),
      type_target<wire::CorrectTarget::Reply>("correct_target_reply"),
      type_target<wire::SubmitMeasurements::Request>("submit_measurements_request"),
      type_target<wire::SubmitMeasurements::Reply>("submit_measurements_reply"),
      type_target<wire::Train::Request>("train_request"),
      type_target<wire::Train::Reply>("train_reply"),
      type_target<wire::Diagnose::Request>("diagnose_request"),
      type_target<wire::Diagnose::Reply>("diagnose_reply"),
      type_target<wire::CheckHealth::Request>("check_health_request"),
      type_target<wire::CheckHealth::Reply>("check_health_reply"),
      type_target<wire::ReadModels::Request>("read_models_request"),
      type_target<wire::ReadModels::Reply>("read_models_reply"),
      type_target<wire::ManageModels::Request>("manage_models_request"),
      type_target<wire::ManageModels::Reply>("manage_models_reply"),
      type_target<wire::ReleaseBatches::Request>("release_batches_request"),
      type_target<wire::ReleaseBatches::Reply>("release_batches_reply"),
      type_target<wire::ModelStatusTopic::Type>("model_status"),
      type_target<wire::TrainingProgressTopic::Type>("training_progress"),
      type_target<wire::ServiceStatusTopic::Type>("service_status"),
      request_target<wire::PredictError>("ask_predict_error"),
      request_target<wire::CorrectTarget>("ask_correct_target"),
      request_target<wire::SubmitMeasurements>("ask_submit_measurements"),
      request_target<wire::Train>("ask_train"),
      request_target<wire::Diagnose>("ask_diagnose"),
      request_target<wire::CheckHealth>("ask_check_health"),
      {"ask_read_models", ask<wire::ReadModels>, mutate_cdr, read_samples},
      {"ask_manage_models", ask<wire::ManageModels>, mutate_cdr, manage_samples},
      {"ask_release_batches", ask<wire::ReleaseBatches>, mutate_cdr, release_samples},
      {"node_predict_errors", ask_as_node<wire::Ros2PredictErrors>, mutate_cdr, node_predictions},
      {"node_correct_targets", ask_as_node<wire::Ros2CorrectTargets>, mutate_cdr, node_corrections},
      {"rtps_packet", guard_packet, mutate_cdr, packets},
      {"findings_json", read_findings, mutate_json},
      {"truth_yaml", read_truth_file, mutate_yaml, truths},
      {"server_yaml", read_server_file, mutate_yaml, server_files},
  };
  return all;
}

}  // namespace trammel::fuzz
