/** Draws on demand; keeps the picture of the surface while only what lies over it changes. */
import {
  BufferGeometry,
  Camera,
  Color,
  DepthTexture,
  LinearSRGBColorSpace,
  Mesh,
  NearestFilter,
  Scene,
  UnsignedIntType,
  WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import type { ViewCamera } from "./camera";
import type { DepthPicture } from "./region";
import { copyMaterial, depthMaterial } from "./shaders";

/** Above this a full picture is too slow to move with. */
const SLOW_MS = 50;
/** Faces of what is drawn instead while the view moves, by a graphics card and by the processor. */
const COARSE_FACES = 40_000;
const FEW_FACES = 10_000;
/** The processor draws what moves with a quarter of the pixels. */
const COARSE_RATIO = 0.5;

export class Painter {
  private readonly renderer: WebGLRenderer;
  private readonly target: WebGLRenderTarget;
  private readonly depthTarget: WebGLRenderTarget;
  private readonly eye = new Camera();
  private readonly copy = wholeScreen(copyMaterial());
  private readonly depth = wholeScreen(depthMaterial());
  private readonly ratio: number;
  /** The processor draws. */
  private readonly software: boolean;
  private baseIsOld = true;
  private depthPicture: DepthPicture | null = null;
  /** Milliseconds that the last full picture took. */
  fullMs = 0;

  constructor(canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, alpha: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.software = /swiftshader|llvmpipe|software/i.test(this.gpu());
    this.ratio = this.software ? 1 : Math.min(window.devicePixelRatio, 2);
    this.renderer.setPixelRatio(this.ratio);
    const depthTexture = new DepthTexture(1, 1, UnsignedIntType);
    // Four samples a pixel cost three times as much where the processor draws.
    this.target = new WebGLRenderTarget(1, 1, { depthTexture, samples: this.software ? 0 : 4 });
    this.target.texture.minFilter = this.target.texture.magFilter = NearestFilter;
    this.depthTarget = new WebGLRenderTarget(1, 1, { depthBuffer: false });
    this.eye.matrixAutoUpdate = false;
    this.eye.matrixWorldAutoUpdate = false;
    this.material(this.copy).uniforms.picture.value = this.target.texture;
    this.material(this.copy).uniforms.depth.value = depthTexture;
    this.material(this.depth).uniforms.depth.value = depthTexture;
  }

  gpu(): string {
    const gl = this.renderer.getContext();
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  }

  setBackground(css: string): void {
    this.renderer.setClearColor(new Color().setStyle(css, LinearSRGBColorSpace), 1);
    this.invalidate();
  }

  resize(width: number, height: number): void {
    this.renderer.setSize(width, height, false);
    const w = Math.max(1, Math.floor(width * this.ratio));
    const h = Math.max(1, Math.floor(height * this.ratio));
    this.target.setSize(w, h);
    this.depthTarget.setSize(w, h);
    this.invalidate();
  }

  /** The stored picture no longer shows the surface as it is. */
  invalidate(): void {
    this.baseIsOld = true;
    this.depthPicture = null;
  }

  get tooSlowToMove(): boolean {
    return this.fullMs > SLOW_MS;
  }

  /** About how many faces can be drawn while the view moves. */
  get coarseFaces(): number {
    return this.software ? FEW_FACES : COARSE_FACES;
  }

  paint(camera: ViewCamera, base: Scene, overlay: Scene): void {
    this.sharpen(this.ratio);
    this.refresh(camera, base);
    this.renderer.setRenderTarget(null);
    this.renderer.clear();
    this.renderer.render(this.copy, this.eye);
    this.renderer.render(overlay, this.eye);
  }

  /** Straight to the screen, for as long as the view moves. */
  paintCoarse(camera: ViewCamera, coarse: Scene): void {
    if (this.software) this.sharpen(COARSE_RATIO);
    this.aim(camera);
    this.invalidate();
    this.renderer.setRenderTarget(null);
    this.renderer.clear();
    this.renderer.render(coarse, this.eye);
  }

  /** So many pixels of the screen's canvas for each CSS pixel; the stored picture has its own. */
  private sharpen(ratio: number): void {
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
  }

  /** What is seen, and how far away. */
  seen(camera: ViewCamera, base: Scene): DepthPicture {
    this.refresh(camera, base);
    if (this.depthPicture) return this.depthPicture;
    const { near, far } = camera.matrices();
    const uniforms = this.material(this.depth).uniforms;
    uniforms.range.value = [near, far];
    uniforms.orthographic.value = camera.orthographic;
    this.renderer.setRenderTarget(this.depthTarget);
    this.renderer.render(this.depth, this.eye);
    const { width, height } = this.depthTarget;
    const bytes = new Uint8Array(4 * width * height);
    this.renderer.readRenderTargetPixels(this.depthTarget, 0, 0, width, height, bytes);
    const depth = new Float32Array(width * height).fill(Infinity);
    for (let i = 0; i < depth.length; i++) {
      if (!bytes[4 * i + 3]) continue;
      const share = (bytes[4 * i] * 65536 + bytes[4 * i + 1] * 256 + bytes[4 * i + 2]) / 16777215;
      depth[i] = near + share * (far - near);
    }
    this.depthPicture = { width, height, ratio: this.ratio, depth };
    return this.depthPicture;
  }

  private refresh(camera: ViewCamera, base: Scene): void {
    this.aim(camera);
    if (!this.baseIsOld) return;
    const start = performance.now();
    this.renderer.setRenderTarget(this.target);
    this.renderer.clear();
    this.renderer.render(base, this.eye);
    // Reading one pixel waits for the card: without it the time would be that of the calls alone.
    this.renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, new Uint8Array(4));
    this.fullMs = performance.now() - start;
    this.baseIsOld = false;
    this.depthPicture = null;
  }

  private aim(camera: ViewCamera): void {
    const { world, projection } = camera.matrices();
    this.eye.matrixWorld.fromArray(world);
    this.eye.matrixWorldInverse.copy(this.eye.matrixWorld).invert();
    this.eye.projectionMatrix.fromArray(projection);
    this.eye.projectionMatrixInverse.copy(this.eye.projectionMatrix).invert();
  }

  private material(scene: Scene): ReturnType<typeof copyMaterial> {
    return (scene.children[0] as Mesh).material as ReturnType<typeof copyMaterial>;
  }

  dispose(): void {
    this.target.dispose();
    this.depthTarget.dispose();
    this.renderer.dispose();
  }
}

function wholeScreen(material: ReturnType<typeof copyMaterial>): Scene {
  const geometry = new BufferGeometry();
  geometry.setDrawRange(0, 3);
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  const scene = new Scene();
  scene.add(mesh);
  return scene;
}

/** Whether this browser draws 3-D at all. */
export function canDraw(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return context !== null;
}
