// The numbers that idl/README.md tells writers of clients are those of the code.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "idl/transport/places.h"
#include "idl/transport/transport.h"
#include "server/base/name_check.h"
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

TEST(WireDocument, WhatModelFilesMayHoldTheWireCanCarry) {
  EXPECT_EQ(kMostNameBytes, MAX_ID);
  EXPECT_EQ(kMostSpellingBytes, MAX_SPELLING);
  EXPECT_EQ(kMostSentenceBytes, MAX_SENTENCE);
  EXPECT_EQ(kMostBatches, MAX_BATCHES);
}

TEST(WireDocument, TellsThePortsTimesAndLimitsOfTheCode) {
  const std::map<std::string, long long> constants = {
      {"kFirstPort", kFirstPort},
      {"kDiscoveryPort", kDiscoveryPort},
      {"kMostDiscoveryServers", kMostDiscoveryServers},
      {"kMostPlaces", kMostPlaces},
      {"kOtherPlaces", kOtherPlaces.count()},
      {"kLease", kLease.count()},
      {"kAnnouncement", kAnnouncement.count()},
      {"kStatusPeriod", kStatusPeriod.count()},
      {"kStatusLost", kStatusLost.count()},
      {"MAX_TARGETS", MAX_TARGETS},
      {"kTargetsPerRequest", kTargetsPerRequest},
      {"MAX_JOINTS", MAX_JOINTS},
      {"MAX_NAME", MAX_NAME},
      {"MAX_ID", MAX_ID},
      {"MAX_SPELLING", MAX_SPELLING},
      {"MAX_SENTENCE", MAX_SENTENCE},
      {"MAX_JOBS", MAX_JOBS},
      {"MAX_ERRORS", MAX_ERRORS},
      {"MAX_BUDGET_LINES", MAX_BUDGET_LINES},
      {"kMaxText", kMaxText},
      {"MAX_BATCHES", MAX_BATCHES},
      {"MAX_VERSIONS", MAX_VERSIONS},
      {"MAX_CELLS", MAX_CELLS},
      {"kMaxComputeSample", kMaxComputeSample},
      {"kMaxTextSample", kMaxTextSample},
      {"kMaxStateSample", kMaxStateSample},
      {"kRequestDepth", kRequestDepth},
      {"kReplyDepth", kReplyDepth},
      {"client_requests", DdsOptions().client_requests},
      {"queued_requests", DdsOptions().queued_requests},
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
      told_of("<Operation>_2_Request", "client", call_writer_qos(kReplyDepth),
              call_reader_qos(kRequestDepth)),
      told_of("<Operation>_2_Reply", "server", call_writer_qos(kReplyDepth),
              call_reader_qos(kReplyDepth)),
      told_of(topic_name(ServiceStatusTopic::kName), "server", service_status_writer_qos(),
              state_reader_qos()),
      told_of(topic_name(ModelStatusTopic::kName), "server", state_writer_qos(),
              state_reader_qos()),
      told_of(topic_name(TrainingProgressTopic::kName), "server", progress_writer_qos(),
              progress_reader_qos())};
  std::vector<Row> told;
  for (const Row& row : rows()) {
    if (row.size() == 6 && (row[1] == "client" || row[1] == "server")) told.push_back(row);
  }
  EXPECT_EQ(told, expected);
}

/// The names of an enumeration of the IDL, in order.
std::vector<std::string> enumerators_of(const std::string& file, const std::string& enumeration) {
  std::ifstream idl(std::string(TRAMMEL_SOURCE_DIR) + "/idl/" + file);
  const std::string text((std::istreambuf_iterator<char>(idl)), {});
  const std::size_t begin = text.find("enum " + enumeration + " {");
  std::istringstream lines(text.substr(begin, text.find('}', begin) - begin));
  std::vector<std::string> names;
  std::string line;
  for (std::getline(lines, line); std::getline(lines, line);) {
    const std::string name = trimmed(line.substr(0, line.find_first_of(",/")));
    if (!name.empty()) names.push_back(name);
  }
  return names;
}

TEST(WireDocument, TellsEveryResultCodeOfTheIdlAndWhatToDo) {
  const std::vector<std::string> names = enumerators_of("common.idl", "ResultCode");
  ASSERT_EQ(names.size(), RESULT_MALFORMED + 1U);
  EXPECT_EQ(names[RESULT_WRONG_CONTRACT], "RESULT_WRONG_CONTRACT");
  EXPECT_EQ(names[RESULT_MALFORMED], "RESULT_MALFORMED");
  std::vector<std::string> told;
  for (const Row& row : rows()) {
    if (row.size() != 4 || !row[0].starts_with("RESULT_")) continue;
    EXPECT_EQ(row[1], std::to_string(told.size())) << row[0];
    EXPECT_FALSE(row[2].empty()) << row[0];
    EXPECT_TRUE(!row[3].empty() || row[0] == "RESULT_OK") << row[0];
    told.push_back(row[0]);
  }
  EXPECT_EQ(told, names);
}

TEST(WireDocument, TellsTheRoleOfEveryOperation) {
  const std::set<std::string> operations = {
      PredictError::kName, CorrectTarget::kName, SubmitMeasurements::kName,
      Train::kName,        Diagnose::kName,      CheckHealth::kName,
      ReadModels::kName,   ManageModels::kName,  ReleaseBatches::kName};
  const std::set<std::string> roles = {"read", "submit", "change", "release"};
  std::set<std::string> told;
  for (const Row& row : rows()) {
    if (row.size() != 3 || !roles.contains(row[1])) continue;
    EXPECT_TRUE(told.insert(row[0]).second) << row[0];
  }
  EXPECT_EQ(told, operations);
}

}  // namespace
}  // namespace trammel::wire
