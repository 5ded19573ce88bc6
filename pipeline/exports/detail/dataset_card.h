#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/exports/detail/exporter.h"

namespace eventgan {

/// The files of a kind that an export has.
struct FilesOfKind {
  const ExportFile* kind = nullptr;
  /// For each split that has any: their names, of those in folders with `*` for what differs. Under
  /// "" if the split is not in their names.
  std::vector<std::pair<std::string, std::vector<std::string>>> by_split;
};

inline constexpr char kCardName[] = "README.md";
inline constexpr char kCroissantName[] = "croissant.json";

/// Writes README.md, a dataset card as the Hugging Face Hub reads it, and croissant.json, both from
/// the format's row and the files that there are: a step, after those of all other files but
/// export.json. What people have made of an earlier run's stays; the notes say so.
std::vector<std::string> write_dataset_card(const ExportWork& work, const ExportFormat& format,
                                            const std::vector<const ExportShard*>& shards);

/// croissant.json: the files, and the records in them, in the words of MLCommons Croissant 1.0
/// (docs.mlcommons.org/croissant). What nobody knows here is left out: `url`, `creator`,
/// `datePublished`, and of an unknown licence (empty) `license`.
std::string croissant_text(const ExportWork& work, const ExportFormat& format,
                           const std::vector<FilesOfKind>& files, const std::string& licence);

}  // namespace eventgan
