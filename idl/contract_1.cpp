#include "idl/contract_1.h"

namespace trammel::wire {
namespace {

constexpr std::size_t kName = 64;

void request(CdrWalk& walk) {
  walk.octets(16);
  walk.wides(1);
  walk.text("server", kName, Text::kToken);
  walk.text("reply_partition", kName, Text::kToken);
  walk.longs(1);
}

void reply_header(CdrWalk& walk) {
  walk.octets(16);
  walk.wides(1);
  walk.longs(1);
  walk.text("message", MAX_SENTENCE, Text::kAny);
  walk.text("server", kName, Text::kToken);
  walk.longs(1);
}

void model(CdrWalk& walk) {
  for (const char* field : {"cell", "id", "hash", "level", "batch_id"}) walk.text(field, MAX_SENTENCE, Text::kAny);
  walk.longs(1);
  walk.wides(2);
  walk.longs(1);
  walk.wides(1);
  walk.flag("in_force");
}

}  // namespace

/// What follows the header in a request of contract 1 is not looked at.
template <>
std::optional<Fault> find_fault<contract_1::Request>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  request(walk);
  return walk.fault();
}

template <>
std::optional<Fault> find_fault<contract_1::ServiceStatus>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  walk.text("server", kName, Text::kToken);
  walk.longs(1);
  walk.text("program_version", MAX_ID, Text::kAny);
  walk.longs(1);
  walk.list("cells", MAX_CELLS, 4, "cell", [&] { walk.text("cells", MAX_ID, Text::kAny); });
  walk.longs(1);
  walk.wides(3);
  walk.longs(1);
  return walk.fault();
}

// Only the refusals of this contract are read: they hold no items.

template <>
std::optional<Fault> find_fault<contract_1::ComputedReply>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  reply_header(walk);
  model(walk);
  static_cast<void>(walk.list("items", 0, 1));
  return walk.fault();
}

template <>
std::optional<Fault> find_fault<contract_1::QueuedReply>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  reply_header(walk);
  walk.wides(1);
  return walk.fault();
}

template <>
std::optional<Fault> find_fault<contract_1::DiagnoseReply>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  reply_header(walk);
  model(walk);
  walk.wides(1);
  for (const char* field : {"findings_json", "page_html"}) walk.text(field, 0, Text::kAny);
  return walk.fault();
}

template <>
std::optional<Fault> find_fault<contract_1::ManageModelsReply>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  reply_header(walk);
  static_cast<void>(walk.list("models", 0, 1));
  walk.longs(1);
  walk.text("text", 0, Text::kAny);
  walk.wides(1);
  walk.text("cell", 0, Text::kAny);
  walk.longs(1);
  walk.text("what", 0, Text::kAny);
  walk.wides(1);
  walk.longs(1);
  walk.flag("in_force");
  return walk.fault();
}

std::string old_type_name(const std::string& type) { return "trammel::wire::" + type; }

Result<dds::Topic*> make_old_status_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, OldServiceStatusTopic::kName,
                    new SafeType<OldServiceStatusTopic::Type>(kMaxStateSample), old_type_name("ServiceStatus"));
}

}  // namespace trammel::wire
