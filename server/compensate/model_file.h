#pragma once

#include <string>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// A model as a file; MODEL_FILE.md says what stands in it.
namespace trammel {

/// The model as text: JSON, one object. Same data, same seed, same content, same hash, same id.
[[nodiscard]] std::string serialize(const CompensatedModel& model);
/// The strictness towards the names, sentences and times of a model, which change no answer.
enum class ModelTexts {
  kChecked,   ///< of a file from outside: see check_texts()
  kAsTheyAre  ///< of a model that was accepted before: it goes on, and whoever shows them cleans
              ///< them
};
/// The model that `text` holds; `where` names the file in messages. Refuses a text that is no
/// model, whose hash does not fit its content, or whose numbers or texts no model can have.
[[nodiscard]] Result<CompensatedModel> deserialize(const std::string& text,
                                                   const std::string& where,
                                                   ModelTexts texts = ModelTexts::kChecked);
[[nodiscard]] Result<CompensatedModel> load_model(const std::string& path);
/// The hash of a model's content. Refuses a text with a byte that was changed since it was written,
/// by the text's own hashes. Cheap: makes no model of it.
[[nodiscard]] Result<std::string> undamaged_hash(const std::string& text, const std::string& where);

}  // namespace trammel
