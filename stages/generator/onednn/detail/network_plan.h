#pragma once

#include <array>
#include <cstddef>
#include <dnnl.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/recently_used.h"
#include "stages/generator/generator.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/detail/decoder_level.h"
#include "stages/generator/onednn/detail/fused_convolution.h"
#include "stages/generator/onednn/detail/network_layers.h"
#include "stages/generator/onednn/detail/winograd_plan.h"
#include "stages/generator/onednn/narrow_layers.h"

namespace eventgan {

/// The calling thread computes with one intra-operation thread while this lives: oneDNN takes as
/// many as OpenMP gives it, and how it splits the work must not depend on the machine. Others that
/// compute on the thread (PyTorch, of a caller in Python) find their own number again.
class OneOpenMpThread {
 public:
  OneOpenMpThread();
  ~OneOpenMpThread();
  OneOpenMpThread(const OneOpenMpThread&) = delete;
  OneOpenMpThread& operator=(const OneOpenMpThread&) = delete;

 private:
  int threads_before_;
};

/// The network for one image size: which convolutions run in which order, and where in one block
/// of memory their buffers lie. Holds no buffers itself; thread safe.
class NetworkPlan {
 public:
  /// `layers` must outlive it. Throws dnnl::error.
  NetworkPlan(NetworkLayers& layers, ImageSize size);

  /// Bytes that a run needs.
  std::size_t block_bytes() const { return layout_.total_bytes(); }

  /// planes [inputs, y, x] as network_planes() gives them, volume [2 bins, y, x]. `block`:
  /// block_bytes(), whatever is in it. `observe` is called in float32 only, and may throw.
  GenerationNotes run(const float* planes, float* volume, std::byte* block,
                      const TensorObserver& observe = {}) const;

  /// The same for the tiles that are wanted, by what tiled_work says of them; nothing else of the
  /// volume is written. `tiles`: a block for layers.layout.
  GenerationNotes run_tiles(const TiledLayers& layers, const TiledWork& work,
                            const TileMask& wanted, const float* planes, float* volume,
                            std::byte* block, std::byte* tiles) const;

  /// What runs in this plan's place, where layers.winograd() is; else null.
  const WinogradPlan* winograd() const { return winograd_ ? &*winograd_ : nullptr; }

  /// oneDNN's names of all kernels.
  std::vector<std::string> implementations() const;

 private:
  struct Buffer {
    std::size_t offset = 0;
    std::size_t size_bytes = 0;
  };

  Buffer add_activations(ImageSize size, int channels);
  void plan_narrow(NetworkLayers& layers);
  void plan_head(NetworkLayers& layers);
  void plan_encoders(NetworkLayers& layers);
  void plan_residual_blocks(NetworkLayers& layers);
  void plan_decoders(NetworkLayers& layers);
  void plan_prediction(NetworkLayers& layers);

  /// Calls compute(Stored()) with the type of the stored activations.
  template <class Compute>
  void with_stored_type(Compute&& compute) const;
  template <class Stored>
  void run_head(const EngineRun& run, const float* planes) const;
  template <class Stored>
  void run_decoder(const EngineRun& run, int level, const std::byte* small) const;
  template <class Stored>
  void run_last_decoder(const EngineRun& run, const std::byte* small, float* volume) const;
  template <class Stored>
  void run_decoder_tiles(const EngineRun& run, const TiledLayers& layers, const TiledWork& work,
                         int level, std::byte* small) const;
  void run_last_tiles(const EngineRun& run, const TiledLayers& layers, const TiledWork& work,
                      const TileMask& wanted, std::byte* small, float* volume) const;

  dnnl::engine engine_;
  ImageSize size_;
  int base_channels_;
  int bins_;
  dnnl::memory::data_type stored_type_;
  BufferLayout layout_;

  std::optional<WinogradPlan> winograd_;  ///< where it is, nothing below is
  /// Where it fits, in place of `head_`, the last decoder's strips and `prediction_`.
  std::optional<NarrowLayers> narrow_;
  std::size_t inputs_ = 0;            ///< of the head
  std::size_t input_ = 0;             ///< [y, x, input] float32
  std::size_t head_rows_buffer_ = 0;  ///< float32
  int head_rows_ = 0;                 ///< of a strip
  std::optional<RowConvolution> head_;
  std::array<Buffer, kNetworkLevels>
      skips_;  ///< what each encoder reads, and the decoder beside it
  std::array<ImageSize, kNetworkLevels> sizes_;
  std::vector<FusedConvolution> encoders_;
  std::vector<FusedConvolution> residuals_;  ///< two a block
  Buffer bottleneck_;                        ///< the last encoder's output, the blocks' too
  Buffer between_;                           ///< within a residual block
  std::vector<DecoderLevel> decoders_;
  std::array<Buffer, kNetworkLevels - 1> decoded_;
  std::optional<RowConvolution> prediction_;
  std::size_t decoded_rows_ = 0;    ///< float32, a strip of the last decoder
  std::size_t predicted_rows_ = 0;  ///< [pixel, channel] float32
  std::size_t scratch_ = 0;
};

/// Plans for the 16 image sizes used last: KITTI has a handful of sizes, a folder of images any
/// number. A plan that is in use lives on when it is dropped here. Thread safe.
class PlanCache {
 public:
  /// `layers` must outlive it.
  explicit PlanCache(NetworkLayers& layers) : layers_(layers) {}

  /// Builds the plan if it is not there; a thread that asks for one that another builds waits for
  /// it, and gets its exception if there is one. Throws dnnl::error; the next call tries again.
  std::shared_ptr<const NetworkPlan> plan(ImageSize size);

 private:
  NetworkLayers& layers_;
  RecentlyUsed<std::array<int, 2>, std::shared_ptr<const NetworkPlan>> plans_{16};
};

}  // namespace eventgan
