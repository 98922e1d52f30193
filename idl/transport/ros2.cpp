#include "idl/transport/ros2.h"

#include "idl/limits.h"

namespace trammel::wire {
namespace {

constexpr std::size_t kMaxNumbers = MAX_TARGETS * MAX_JOINTS;
constexpr std::size_t kPoseNumbers = 7;

void numbers(CdrWalk& walk, const char* field, std::size_t most) {
  walk.wides(walk.list(field, most, 8));
}
void octets(CdrWalk& walk, const char* field) { walk.octets(walk.list(field, MAX_TARGETS, 1)); }
void poses(CdrWalk& walk, const char* field) {
  walk.wides(kPoseNumbers * walk.list(field, MAX_TARGETS, 8 * kPoseNumbers));
}

void begin_question(CdrWalk& walk) {
  walk.text("id", MAX_NAME, Text::kToken);
  walk.text("server", MAX_NAME, Text::kToken);
  for (const char* field : {"cell", "tool", "payload"}) walk.text(field, MAX_ID, Text::kPlain);
  walk.longs(1);
}

void begin_answer(CdrWalk& walk) {
  walk.text("id", MAX_NAME, Text::kToken);
  walk.text("server", MAX_NAME, Text::kToken);
  walk.longs(1);
  walk.text("message", MAX_SENTENCE, Text::kAny);
  walk.longs(1);
  walk.text("model_hash", MAX_ID, Text::kAny);
  walk.longs(1);
}

std::optional<Fault> at_its_end(CdrWalk& walk) {
  walk.end();
  return walk.fault();
}

}  // namespace

template <>
std::optional<Fault> find_fault<ros2::PredictErrors_>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  begin_question(walk);
  walk.longs(1);
  numbers(walk, "joints_rad", kMaxNumbers);
  return at_its_end(walk);
}

template <>
std::optional<Fault> find_fault<ros2::PredictedErrors_>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  begin_answer(walk);
  poses(walk, "nominal");
  poses(walk, "predicted");
  numbers(walk, "stddev_m", 3 * MAX_TARGETS);
  numbers(walk, "true_stddev_m", 3 * MAX_TARGETS);
  octets(walk, "in_domain");
  return at_its_end(walk);
}

template <>
std::optional<Fault> find_fault<ros2::CorrectTargets_>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  begin_question(walk);
  poses(walk, "poses");
  octets(walk, "conf");
  walk.longs(1);
  numbers(walk, "joints_rad", kMaxNumbers);
  return at_its_end(walk);
}

template <>
std::optional<Fault> find_fault<ros2::CorrectedTargets_>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  begin_answer(walk);
  octets(walk, "status");
  poses(walk, "commanded");
  walk.longs(1);
  numbers(walk, "joints_rad", kMaxNumbers);
  for (const char* field : {"error_before_m", "error_after_m", "sigma_m"})
    numbers(walk, field, MAX_TARGETS);
  walk.list("messages", MAX_TARGETS, 4, "target",
            [&] { walk.text("messages", MAX_SENTENCE, Text::kAny); });
  return at_its_end(walk);
}

std::string message_id(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  walk.text("id", MAX_NAME, Text::kToken);
  if (!walk.good()) return {};
  std::string id;
  try {
    eprosima::fastcdr::FastBuffer buffer(
        reinterpret_cast<char*>(const_cast<unsigned char*>(sample.data())), sample.size());
    eprosima::fastcdr::Cdr reader(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN,
                                  eprosima::fastcdr::Cdr::DDS_CDR);
    reader.read_encapsulation();
    reader >> id;
  } catch (...) {
    return {};
  }
  return id;
}

}  // namespace trammel::wire
