// Embree at the other end of a pipe, for benches/src/bin/trace.rs: one command per line on standard input, one line of
// answer each, so that both sides can take turns on the same rays.
//
//   triangles FILE           raw f32, nine per triangle
//   build robust|fast N      a scene of high build quality with N threads -> seconds, bytes
//   rays any|closest FILE    raw f32, eight per ray: origin, t_min, direction, t_max
//   run robust|fast          traces the rays, one at a time, in this thread -> seconds, hits
//   hits FILE                writes the last run's hits: t, u, v, primitive (u32), normal (not of unit length); for `any`
//                            one f32 per ray, 1 where blocked
//
// The few declarations of Embree 4's C interface that this needs are repeated here (from its API documentation,
// https://github.com/RenderKit/embree, Apache-2.0), so that a shared library without headers, as in the Python wheel
// `embreex`, will do.

#include <sys/types.h>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>
#include <xmmintrin.h>
#include <pmmintrin.h>

extern "C" {
typedef struct RTCDeviceTy* RTCDevice;
typedef struct RTCSceneTy* RTCScene;
typedef struct RTCGeometryTy* RTCGeometry;
typedef bool (*RTCMemoryMonitorFunction)(void*, ssize_t, bool);
struct alignas(16) RTCRay {
    float org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar;
    unsigned mask, id, flags;
};
struct alignas(16) RTCHit {
    float Ng_x, Ng_y, Ng_z, u, v;
    unsigned primID, geomID, instID[1], instPrimID[1];
};
struct RTCRayHit {
    RTCRay ray;
    RTCHit hit;
};
RTCDevice rtcNewDevice(const char*);
void rtcReleaseDevice(RTCDevice);
ssize_t rtcGetDeviceProperty(RTCDevice, int);
void rtcSetDeviceMemoryMonitorFunction(RTCDevice, RTCMemoryMonitorFunction, void*);
RTCScene rtcNewScene(RTCDevice);
void rtcSetSceneBuildQuality(RTCScene, int);
void rtcSetSceneFlags(RTCScene, int);
void rtcCommitScene(RTCScene);
void rtcReleaseScene(RTCScene);
RTCGeometry rtcNewGeometry(RTCDevice, int);
void rtcSetGeometryBuildQuality(RTCGeometry, int);
void rtcSetSharedGeometryBuffer(RTCGeometry, int, unsigned, int, const void*, size_t, size_t, size_t);
void rtcCommitGeometry(RTCGeometry);
unsigned rtcAttachGeometry(RTCScene, RTCGeometry);
void rtcReleaseGeometry(RTCGeometry);
void rtcIntersect1(RTCScene, RTCRayHit*, void*);
void rtcOccluded1(RTCScene, RTCRay*, void*);
}

enum { VERSION = 0, QUALITY_HIGH = 2, FLAG_ROBUST = 1 << 2, TRIANGLE = 0, INDEX = 0, VERTEX = 1 };
enum { UINT3 = 0x5003, FLOAT3 = 0x9003 };
static const unsigned NONE = ~0u;

struct Built {
    RTCDevice device = nullptr;
    RTCScene scene = nullptr;
    ssize_t bytes = 0;
};
struct Found {
    float t, u, v;
    unsigned primitive;
    float normal[3];
};

static double now() {
    using namespace std::chrono;
    return duration<double>(steady_clock::now().time_since_epoch()).count();
}

static bool watch(void* bytes, ssize_t change, bool) {
    *static_cast<ssize_t*>(bytes) += change;
    return true;
}

static std::vector<float> read(const std::string& name) {
    FILE* file = fopen(name.c_str(), "rb");
    if (!file) {
        fprintf(stderr, "cannot read %s\n", name.c_str());
        exit(1);
    }
    fseek(file, 0, SEEK_END);
    std::vector<float> values(size_t(ftell(file)) / sizeof(float) + 4);
    rewind(file);
    size_t got = fread(values.data(), sizeof(float), values.size() - 4, file);
    fclose(file);
    values.resize(got + 4);  // Embree reads 16 bytes of the last vertex.
    return values;
}

int main() {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);  // as Embree's manual recommends
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    std::vector<float> vertices, rays;
    std::vector<unsigned> indices;
    std::vector<Found> found;
    std::vector<float> blocked;
    std::map<std::string, Built> scenes;
    bool any = false;
    size_t count = 0;
    char line[4096];
    while (fgets(line, sizeof line, stdin)) {
        char verb[64] = "", a[1024] = "", b[2048] = "";
        sscanf(line, "%63s %1023s %2047s", verb, a, b);
        std::string command = verb;
        if (command == "triangles") {
            for (auto& [name, built] : scenes) {
                rtcReleaseScene(built.scene);
                rtcReleaseDevice(built.device);
            }
            scenes.clear();
            vertices = read(a);
            indices.resize((vertices.size() - 4) / 3);
            for (size_t i = 0; i < indices.size(); i++) indices[i] = unsigned(i);
            printf("%zu\n", indices.size() / 3);
        } else if (command == "build") {
            Built& built = scenes[a];
            if (built.scene) {
                rtcReleaseScene(built.scene);
                rtcReleaseDevice(built.device);
            }
            built.bytes = 0;
            std::string config = std::string("threads=") + b + ",set_affinity=0";
            built.device = rtcNewDevice(config.c_str());
            if (!built.device || rtcGetDeviceProperty(built.device, VERSION) < 40000) {
                fprintf(stderr, "this driver speaks to Embree 4\n");
                return 1;
            }
            rtcSetDeviceMemoryMonitorFunction(built.device, watch, &built.bytes);
            built.scene = rtcNewScene(built.device);
            rtcSetSceneBuildQuality(built.scene, QUALITY_HIGH);
            rtcSetSceneFlags(built.scene, strcmp(a, "robust") == 0 ? FLAG_ROBUST : 0);
            RTCGeometry geometry = rtcNewGeometry(built.device, TRIANGLE);
            rtcSetGeometryBuildQuality(geometry, QUALITY_HIGH);
            rtcSetSharedGeometryBuffer(geometry, VERTEX, 0, FLOAT3, vertices.data(), 0, 12, (vertices.size() - 4) / 3);
            rtcSetSharedGeometryBuffer(geometry, INDEX, 0, UINT3, indices.data(), 0, 12, indices.size() / 3);
            double start = now();
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(built.scene, geometry);
            rtcReleaseGeometry(geometry);
            rtcCommitScene(built.scene);
            printf("%.6f %zd %zd\n", now() - start, built.bytes, rtcGetDeviceProperty(built.device, VERSION));
        } else if (command == "rays") {
            any = strcmp(a, "any") == 0;
            rays = read(b);
            count = (rays.size() - 4) / 8;
            found.assign(count, Found{});
            blocked.assign(count, 0.0f);
            printf("%zu\n", count);
        } else if (command == "run") {
            RTCScene scene = scenes[a].scene;
            size_t hits = 0;
            double start = now();
            if (any) {
                for (size_t i = 0; i < count; i++) {
                    const float* r = &rays[8 * i];
                    RTCRay ray = {r[0], r[1], r[2], r[3], r[4], r[5], r[6], 0.0f, r[7], NONE, 0, 0};
                    rtcOccluded1(scene, &ray, nullptr);
                    bool hit = ray.tfar < 0.0f;
                    blocked[i] = hit ? 1.0f : 0.0f;
                    hits += hit;
                }
            } else {
                for (size_t i = 0; i < count; i++) {
                    const float* r = &rays[8 * i];
                    RTCRayHit q;
                    q.ray = {r[0], r[1], r[2], r[3], r[4], r[5], r[6], 0.0f, r[7], NONE, 0, 0};
                    q.hit.geomID = NONE;
                    q.hit.primID = NONE;
                    q.hit.instID[0] = NONE;
                    rtcIntersect1(scene, &q, nullptr);
                    bool hit = q.hit.geomID != NONE;
                    if (hit)
                        found[i] = {q.ray.tfar, q.hit.u, q.hit.v, q.hit.primID, {q.hit.Ng_x, q.hit.Ng_y, q.hit.Ng_z}};
                    else
                        found[i].primitive = NONE;
                    hits += hit;
                }
            }
            printf("%.6f %zu\n", now() - start, hits);
        } else if (command == "hits") {
            FILE* file = fopen(a, "wb");
            if (!file) {
                fprintf(stderr, "cannot write %s\n", a);
                return 1;
            }
            if (any)
                fwrite(blocked.data(), sizeof(float), count, file);
            else
                fwrite(found.data(), sizeof(Found), count, file);
            fclose(file);
            printf("%zu\n", count);
        } else {
            fprintf(stderr, "unknown command: %s", line);
            return 1;
        }
        fflush(stdout);
    }
    return 0;
}
