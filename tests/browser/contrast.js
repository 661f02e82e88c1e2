// The weakest contrast between text and what is behind it (WCAG 2), and where it is.
() => {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });

  function channels(colour) {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  }

  function luminance([red, green, blue]) {
    const linear = [red, green, blue].map((channel) => {
      const share = channel / 255;
      return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  }

  function behind(node) {
    const colour = channels(getComputedStyle(node).backgroundColor);
    return colour[3] > 200 ? colour : behind(node.parentElement);
  }

  let weakest = [99, ""];
  for (const node of document.querySelectorAll("h1, h2, h3, p, th, td, small, span, dt, dd, li, text, a")) {
    if (node.textContent.trim() && node.checkVisibility() && !node.closest("nav")) {
      const style = getComputedStyle(node);
      const text = luminance(channels(node.tagName === "text" ? style.fill : style.color));
      const ground = luminance(behind(node));
      const contrast = (Math.max(text, ground) + 0.05) / (Math.min(text, ground) + 0.05);
      if (contrast < weakest[0]) {
        weakest = [contrast, node.outerHTML.slice(0, 120)];
      }
    }
  }
  return weakest;
}
