/* The event volume of two grey images, PGM files of 8 bits, to the standard output: float32
 * [18, height, width], then the events that could have made it, on the standard error.
 *   cc example.c -leventgan -o example && ./example 0.pgm 1.pgm > volume.f32 2> events.txt */
#include <eventgan.h>
#include <stdio.h>
#include <stdlib.h>

static void check(int result) {
  if (result == EVENTGAN_COMPLETE) return;
  fprintf(stderr, "%s\n", eventgan_error());
  exit(result);
}

static eventgan_images read_pgm(const char* path) {
  int width = 0, height = 0, levels = 0;
  FILE* file = fopen(path, "rb");
  unsigned char* grey = malloc(1 << 24);
  if (!file || !grey || fscanf(file, "P5 %d %d %d", &width, &height, &levels) != 3) exit(66);
  fgetc(file); /* the blank behind the header */
  if (width < 1 || height < 1 || width > (1 << 24) / height || levels != 255) exit(66);
  if (fread(grey, (size_t)width, (size_t)height, file) != (size_t)height) exit(66);
  fclose(file);
  return (eventgan_images){grey, 1, height, width, {0, width, 1, 0}, 1, EVENTGAN_UINT8};
}

int main(int count, char** paths) {
  if (count != 3) return EVENTGAN_USAGE;
  eventgan_images previous = read_pgm(paths[1]), following = read_pgm(paths[2]);
  eventgan_generator* generator;
  check(eventgan_load("{\"generator\": {\"weights\": \"shipped:8\"}}", &generator));
  int32_t shape[3]; /* channels, height, width */
  check(eventgan_shape(generator, previous.height, previous.width, 1, 1, shape, NULL));
  const uint64_t size = (uint64_t)shape[0] * (uint64_t)shape[1] * (uint64_t)shape[2];
  float* volume = malloc(size * sizeof(float));
  check(eventgan_generate(generator, &previous, &following, 0, volume, size, NULL, 0));
  fwrite(volume, sizeof(float), size, stdout);
  eventgan_event* events;
  uint64_t drawn;
  check(eventgan_sample_events(volume, shape[0] / 2, shape[1], shape[2], 0.1, 0, 0, &events, &drawn));
  for (uint64_t i = 0; i < drawn; ++i) {
    fprintf(stderr, "%.9f %d %d %d\n", events[i].t, events[i].x, events[i].y, events[i].p);
  }
  eventgan_free_events(events);
  eventgan_free(generator);
}
