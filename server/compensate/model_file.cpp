#include "server/compensate/model_file.h"

#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <set>

#include "server/base/hash.h"
#include "server/base/json_guard.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/compensate/file/check_parts.h"
#include "server/compensate/file/check_texts.h"
#include "server/compensate/file/keys.h"
#include "server/compensate/file/read_parts.h"
#include "server/compensate/file/self_test.h"
#include "server/compensate/file/write_parts.h"

namespace trammel {

namespace {

using Json = nlohmann::json;
using model_file::kFormat;
using Members = std::map<std::string, std::string_view>;

/// Text of a file as a message may show it.
std::string excerpt(std::string_view text) { return shown_short(text, 120); }

/// Checks that the file has the supported format.
Status check_format(const Members& members, const std::string& where) {
  const auto said = members.find("trammel_model");
  if (said == members.end())
    return refused("not a Trammel model: no trammel_model").in(where).of("trammel_model");
  if (said->second == std::to_string(kFormat)) return {};
  return refused("model format {}, this program reads {}", excerpt(said->second), kFormat)
      .in(where)
      .of("trammel_model")
      .with_text(excerpt(said->second));
}

/// Checks that the outermost keys are there, without others: a damaged key must not pass for a
/// missing one.
Status check_keys(const Members& members, const std::string& where) {
  static const std::set<std::string_view> kKeys = {
      "content", "hash", "self_test", "self_test_hash", "stamp", "stamp_hash", "trammel_model"};
  for (const auto& [key, value] : members) {
    if (!kKeys.contains(key))
      return refused("not a Trammel model: unknown key {}", excerpt(key))
          .in(where)
          .of(excerpt(key));
  }
  for (const std::string_view key : kKeys) {
    if (!members.contains(std::string(key)))
      return refused("not a Trammel model: no {}", key).in(where).of(std::string(key));
  }
  return {};
}

/// Checks that `by` is the hash of `of`. Both are taken as bytes from the file.
Status check_hash(const Members& members, const std::string& of, const std::string& by,
                  const std::string& where) {
  const std::string hash = sha256_hex(members.at(of));
  if (members.at(by) == '"' + hash + '"') return {};
  return refused("damaged: its {} is {}, its {} has {}", by, excerpt(members.at(by)), of, hash)
      .in(where)
      .of(by);
}

/// Checks that no byte has changed since the file was written. Looks at the bytes, before anything
/// is parsed.
Status check_undamaged(const Members& members, const std::string& where) {
  TRY(check_format(members, where));
  TRY(check_keys(members, where));
  TRY(check_hash(members, "content", "hash", where));
  TRY(check_hash(members, "stamp", "stamp_hash", where));
  return check_hash(members, "self_test", "self_test_hash", where);
}

Result<CompensatedModel> checked_model(const Members& members, const std::string& where,
                                       ModelTexts texts) {
  TRY(check_undamaged(members, where));
  const Json content = Json::parse(members.at("content"));
  const Json stamp = Json::parse(members.at("stamp"));
  const Status can_be_told =
      texts == ModelTexts::kChecked ? model_file::check_texts(content, stamp) : Status();
  if (!can_be_told) return Failure(can_be_told.error()).in(where);
  ModelParts parts = TRY(model_file::parts_from(content, stamp, where));
  const Status possible = model_file::check_parts(parts);
  Result<CompensatedModel> model =
      possible ? CompensatedModel::make(std::move(parts)) : tl::make_unexpected(possible.error());
  if (model) {
    const Status same = model_file::check_self_test(*model, Json::parse(members.at("self_test")));
    if (!same) model = tl::make_unexpected(same.error());
  }
  return std::move(model).map_error(
      [&](Error error) { return Failure(std::move(error)).in(where).value(); });
}

}  // namespace

std::string serialize(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const Json stamp = model_file::stamp_of(provenance);
  const Json self_test = model_file::self_test_of(model);
  const Json file = {{"trammel_model", kFormat},
                     {"hash", provenance.hash},
                     {"stamp", stamp},
                     {"stamp_hash", sha256_hex(stamp.dump())},
                     {"self_test", self_test},
                     {"self_test_hash", sha256_hex(self_test.dump())},
                     {"content", model_file::content_of(model.parts())}};
  // The last byte closes the object, so a text that was cut off is no longer one.
  return file.dump();
}

Result<CompensatedModel> deserialize(const std::string& text, const std::string& where,
                                     ModelTexts texts) {
  try {
    return json_members(text, where).and_then([&](const Members& members) {
      return checked_model(members, where, texts);
    });
  } catch (const Json::exception& error) {
    return refused("not a Trammel model: {}", excerpt(error.what())).in(where);
  } catch (const std::bad_alloc&) {
    return failure(ErrorCode::kTooLarge, "its {} bytes ask for more memory than there is",
                   text.size())
        .in(where)
        .with_value(text.size());
  }
}

Result<std::string> undamaged_hash(const std::string& text, const std::string& where) {
  return json_members(text, where).and_then([&](const Members& members) -> Result<std::string> {
    TRY(check_undamaged(members, where));
    const std::string_view quoted = members.at("hash");
    return std::string(quoted.substr(1, quoted.size() - 2));
  });
}

Result<CompensatedModel> load_model(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return deserialize(text, path); });
}

}  // namespace trammel
