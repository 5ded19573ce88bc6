#pragma once

/* libeventgan: event volumes of two images each, by the engine of the program `eventgan`: bit for
 * bit those in its shards. For C and whatever calls C; the Python package calls it by ctypes.
 *
 * Every function may be called from several threads at once, with one generator too, and computes
 * on the thread that calls it. A function that returns an int returns an eventgan_result; for all
 * but EVENTGAN_COMPLETE eventgan_error() has the reason, and what it was to write is undefined.
 * Nothing is thrown. Strings are UTF-8 and end with a zero.
 *
 * A process may fork at any time: fork() waits for the pairs that other threads are at, and the
 * child's generators are as good as its parent's.
 */

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define EVENTGAN_API __attribute__((visibility("default")))

/* Those of the program's exit codes that can come, and one. */
enum eventgan_result {
  EVENTGAN_COMPLETE = 0,
  EVENTGAN_FAILED = 1,
  EVENTGAN_USAGE = 64,         /* the caller asked for something that cannot be */
  EVENTGAN_INPUT_MISSING = 66, /* a file that the manifest names is missing or broken */
  EVENTGAN_OUT_OF_MEMORY = 71
};

typedef struct eventgan_generator eventgan_generator;

enum eventgan_number {
  EVENTGAN_UINT8 = 0,
  EVENTGAN_FLOAT32 = 1, /* from 0 to 1, rounded to the 256 levels of an image file */
  EVENTGAN_FLOAT64 = 2  /* likewise */
};

/* `count` images of one size in the caller's memory, which may lie there in any way: number
 * [i, y, x, channel] is at data + i strides[0] + y strides[1] + x strides[2] + channel strides[3]
 * bytes, aligned or not. */
typedef struct eventgan_images {
  const void* data;
  int64_t count;
  int64_t height; /* px, of each image */
  int64_t width;
  int64_t strides[4];
  int32_t channels; /* 1, grey, or 3: red, green, blue */
  int32_t number;   /* an eventgan_number */
} eventgan_images;

/* Labels of the image on which they are, in its pixels, and where their places in the volume go. */
typedef struct eventgan_labels {
  /* [box_count, 4]: left, top, right, bottom by edges, so that a whole image is 0, 0, W, H. */
  const double* boxes;
  int64_t box_count; /* -1: unknown, which is not the same as none */
  double* clipped;   /* [box_count, 4] in the volume's pixels, clipped to what it shows */
  double* unclipped; /* [box_count, 4] */
  /* [person_count, joint_count, 2]: x, y, whose whole numbers are pixels' centres; NaN: none. */
  const double* joints;
  int64_t person_count; /* -1: unknown */
  int64_t joint_count;
  double* placed; /* [person_count, joint_count, 2] in the volume's pixels, NaN where none */
} eventgan_labels;

/* Events of a volume, in time order. */
typedef struct eventgan_event {
  double t;  /* seconds from the first image */
  int32_t x; /* px */
  int32_t y;
  int8_t p; /* 1 positive, 0 negative */
} eventgan_event;

/* "1.0.0" */
EVENTGAN_API const char* eventgan_version(void);

/* Why the last call of this thread that failed did so: "expected X, got Y, in PATH", a line a
 * fault. Valid until its next call. */
EVENTGAN_API const char* eventgan_error(void);

/* Makes a generator of those parts of a manifest that make a volume of two images: the keys seed,
 * image, generator and volume of `manifest`, a JSON object; "{}" is the shipped network in float32.
 * No other key may be there; paths in it are absolute. */
EVENTGAN_API int eventgan_load(const char* manifest, eventgan_generator** generator);

/* A generator that no call uses any more, or NULL. */
EVENTGAN_API void eventgan_free(eventgan_generator* generator);

/* A JSON object, valid as long as the generator:
 *   bins           per polarity: a volume has twice as many channels
 *   description    engine, precision and the libraries that affect the bytes
 *   weights_hash   SHA-256 of the weights file; of a model, of its description
 *   training_gaps  [first, last] in frames, on which the network was trained, or null
 *   draws          whether thresholds, noise, events or motion are drawn for each pair
 *   warnings       what to know before trusting the volumes, a list of strings */
EVENTGAN_API const char* eventgan_describe(const eventgan_generator* generator);

/* For images of that size: `shape` gets the volume's channels, height and width,
 * `source_to_volume` the map [2, 3] of their points to the volume's. EVENTGAN_OUT_OF_MEMORY if
 * there is not enough to make and to hold `count` volumes on `threads` threads. */
EVENTGAN_API int eventgan_shape(const eventgan_generator* generator, int64_t height, int64_t width,
                                int64_t count, int32_t threads, int32_t shape[3],
                                double source_to_volume[6]);

/* Makes the volumes of pairs: of image i of `previous` and of `following`, which are alike in
 * count and size, the values [2 bins, H, W] at volumes + i * 2 bins * H * W: positive bins in time
 * order, then negative ones; finite, >= 0. `size`: of them all, in floats. `draw`: which of the
 * draws for a pair, if the manifest asks for any: another number gives another volume, 0 that of
 * shards.
 *
 * next NULL: all pairs. Else pairs *next, *next + 1, ... until there are no more, or `most` are
 * made: threads that give the same `next`, at first 0, share the work. It is added to atomically;
 * who sets it to the count stops them, as a call that fails does. */
EVENTGAN_API int eventgan_generate(const eventgan_generator* generator,
                                   const eventgan_images* previous,
                                   const eventgan_images* following, uint64_t draw, float* volumes,
                                   uint64_t size, int64_t* next, int64_t most);

/* Makes the volume of one pair as above, by its labels if the manifest's scope asks for them, and
 * what a shard has beside it. `gap`: between the images, in frames, >= 1. `json` gets an object,
 * valid until this thread's next call:
 *   statistics   nonzero_fraction, max, sum_positive, sum_negative, flags, eta98; if the scope is a
 *                part of the volume, generated_fraction and tiles, rows of 0 and 1
 *   threshold    that was drawn for the pair, if the manifest asks for that */
EVENTGAN_API int eventgan_sample(const eventgan_generator* generator,
                                 const eventgan_images* previous, const eventgan_images* following,
                                 const eventgan_labels* labels, int32_t gap, uint64_t draw,
                                 float* volume, uint64_t size, const char** json);

/* The image as the network sees it: grey, resized, blurred, at its place in the volume's height
 * and width. `size`: of `grey`, in bytes. */
EVENTGAN_API int eventgan_prepare(const eventgan_generator* generator, const eventgan_images* image,
                                  uint8_t* grey, uint64_t size);

/* Draws events that could have made a volume [2 bins, height, width] of finite values >= 0, over
 * duration_s > 0 seconds. `rounded`: each value becomes the nearest number of events, not a draw
 * of Poisson's distribution with that mean; not more than 10^9 altogether, nor more than there is
 * memory for. `events` goes back with eventgan_free_events. */
EVENTGAN_API int eventgan_sample_events(const float* volume, int32_t bins, int32_t height,
                                        int32_t width, double duration_s, uint64_t seed,
                                        int32_t rounded, eventgan_event** events, uint64_t* count);

EVENTGAN_API void eventgan_free_events(eventgan_event* events);

/* The representations that eventgan_represent knows, one a line, with tabs between: word, symbol of
 * its number (or nothing), shape, type, equation with its source, whose networks read it. */
EVENTGAN_API const char* eventgan_representations(void);

/* Writes events in time order as an array: max(1, channels) x height x width numbers, in C order,
 * at `values`, of `size` bytes. `representation` is a word, with ":" and its number:
 * "histogram:10". `times`: the interval's begin and end, seconds, NULL: the first and the last
 * event's. values NULL: only `channels` (0: an array [height, width]) and `number`, an
 * eventgan_number, are given. */
EVENTGAN_API int eventgan_represent(const eventgan_event* events, uint64_t count,
                                    const char* representation, int32_t height, int32_t width,
                                    const double* times, int32_t* channels, int32_t* number,
                                    void* values, uint64_t size);

/* Decodes a volume of a shard: `chunk` is what events/volume holds of it (H5Dread_chunk), stored as
 * numbers of 1 byte (uint8), 2 (float16) or 4 (float32) that went through HDF5's filters shuffle,
 * deflate (if `is_deflated`) and fletcher32. volume[i] = scale * number i; `size`: how many there
 * are. EVENTGAN_INPUT_MISSING if the chunk is damaged, or of another size. */
EVENTGAN_API int eventgan_decode(const void* chunk, uint64_t chunk_size, int32_t number_size,
                                 int32_t is_deflated, float scale, float* volume, uint64_t size);

/* For a process that is about to end while other threads of it may still call: waits for the pairs
 * they are at, and holds what they call from now on for ever. The calling thread goes on. */
EVENTGAN_API void eventgan_end(void);

#ifdef __cplusplus
}
#endif
