// The numbers that idl/README.md tells writers of clients are those of the code.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "idl/transport.h"
#include "server/dds/dds_options.h"

namespace trammel::wire {
namespace {

using Row = std::vector<std::string>;

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" `");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" `") - first + 1);
}

Row cells_of(const std::string& line) {
  Row row;
  std::istringstream cells(line.substr(1));
  for (std::string cell; std::getline(cells, cell, '|');) row.push_back(trimmed(cell));
  return row;
}

/// The rows of all tables of the page.
const std::vector<Row>& rows() {
  static const std::vector<Row> kRows = [] {
    std::ifstream page(std::string(TRAMMEL_SOURCE_DIR) + "/idl/README.md");
    std::vector<Row> read;
    for (std::string line; std::getline(page, line);) {
      if (line.starts_with("|")) read.push_back(cells_of(line));
    }
    return read;
  }();
  return kRows;
}

TEST(WireDocument, TellsThePortsTimesAndLimitsOfTheCode) {
  const std::map<std::string, long long> constants = {{"kFirstPort", kFirstPort},
                                                      {"kLease", kLease.count()},
                                                      {"kAnnouncement", kAnnouncement.count()},
                                                      {"kStatusPeriod", kStatusPeriod.count()},
                                                      {"kStatusLost", kStatusLost.count()},
                                                      {"MAX_TARGETS", MAX_TARGETS},
                                                      {"kTargetsPerRequest", kTargetsPerRequest},
                                                      {"MAX_JOINTS", MAX_JOINTS},
                                                      {"MAX_NAME", MAX_NAME},
                                                      {"MAX_BATCHES", MAX_BATCHES},
                                                      {"MAX_VERSIONS", MAX_VERSIONS},
                                                      {"MAX_CELLS", MAX_CELLS},
                                                      {"kMaxComputeSample", kMaxComputeSample},
                                                      {"kMaxTextSample", kMaxTextSample},
                                                      {"kMaxStateSample", kMaxStateSample},
                                                      {"kRequestDepth", kRequestDepth},
                                                      {"kReplyDepth", kReplyDepth},
                                                      {"max_clients", DdsOptions().max_clients}};
  std::map<std::string, long long> told;
  for (const Row& row : rows()) {
    if (row.size() == 3 && constants.contains(row[2])) told[row[2]] = std::stoll(row[1]);
  }
  EXPECT_EQ(told, constants);
}

std::string policy(dds::ReliabilityQosPolicyKind kind) {
  return kind == dds::RELIABLE_RELIABILITY_QOS ? "reliable" : "best effort";
}
std::string policy(dds::DurabilityQosPolicyKind kind) {
  return kind == dds::TRANSIENT_LOCAL_DURABILITY_QOS ? "transient local" : "volatile";
}
std::string policy(const dds::HistoryQosPolicy& history) {
  if (history.kind == dds::KEEP_ALL_HISTORY_QOS) return "keep all";
  return "keep last " + std::to_string(history.depth);
}

Row told_of(const std::string& topic, const std::string& writer, const dds::DataWriterQos& written,
            const dds::DataReaderQos& read) {
  EXPECT_EQ(written.reliability().kind, read.reliability().kind) << topic;
  EXPECT_EQ(written.durability().kind, read.durability().kind) << topic;
  return {topic,
          writer,
          policy(written.reliability().kind),
          policy(written.durability().kind),
          policy(written.history()),
          policy(read.history())};
}

TEST(WireDocument, TellsTheQosOfEveryTopic) {
  const std::vector<Row> expected = {
      told_of("<Operation>_Request", "client", call_writer_qos(kReplyDepth), call_reader_qos(kRequestDepth)),
      told_of("<Operation>_Reply", "server", call_writer_qos(kReplyDepth), call_reader_qos(kReplyDepth)),
      told_of(ServiceStatusTopic::kName, "server", service_status_writer_qos(), state_reader_qos()),
      told_of(ModelStatusTopic::kName, "server", state_writer_qos(), state_reader_qos()),
      told_of(ModelSnapshotTopic::kName, "server", state_writer_qos(), state_reader_qos()),
      told_of(TrainingProgressTopic::kName, "server", progress_writer_qos(), progress_reader_qos())};
  std::vector<Row> told;
  for (const Row& row : rows()) {
    if (row.size() == 6 && (row[1] == "client" || row[1] == "server")) told.push_back(row);
  }
  EXPECT_EQ(told, expected);
}

TEST(WireDocument, TellsTheNumberOfEveryResultCode) {
  const std::vector<std::string> names = {"RESULT_OK",
                                          "RESULT_UNSUPPORTED",
                                          "RESULT_INVALID_ARGUMENT",
                                          "RESULT_OUT_OF_RESOURCES",
                                          "RESULT_UNKNOWN_OPERATION",
                                          "RESULT_UNKNOWN_EXCEPTION",
                                          "RESULT_REFUSED",
                                          "RESULT_NOT_FOUND",
                                          "RESULT_CONFLICT",
                                          "RESULT_TOO_LARGE",
                                          "RESULT_BUSY",
                                          "RESULT_INTERNAL",
                                          "RESULT_WRONG_CONTRACT"};
  ASSERT_EQ(names.size(), RESULT_WRONG_CONTRACT + 1U);
  std::vector<std::string> told;
  for (const Row& row : rows()) {
    if (row.size() != 4 || !row[0].starts_with("RESULT_")) continue;
    EXPECT_EQ(row[1], std::to_string(told.size())) << row[0];
    told.push_back(row[0]);
  }
  EXPECT_EQ(told, names);
}

}  // namespace
}  // namespace trammel::wire
